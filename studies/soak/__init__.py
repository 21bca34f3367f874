"""Soak runs: random faults for hours, and the matrix of which fault the ECU detects, for the person who has to trust it."""
