"""Checks before any physics is blamed: units, signs and clocks of channels, and one simulation of a user's model."""
