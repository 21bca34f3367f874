"""Compiled loops over whole recordings."""
