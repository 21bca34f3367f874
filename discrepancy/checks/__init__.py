"""Checks before the search: units, signs and clocks of channels, and one simulation of a user's model."""
