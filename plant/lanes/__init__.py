"""Several machines at once, side by side in the lanes of vectors."""
