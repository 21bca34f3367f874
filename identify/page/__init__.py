"""The page of one identification."""
