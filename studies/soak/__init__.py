"""Soak runs: random faults for hours, and the matrix of which fault is detected by whom, for engineers who have to trust the ECU."""
