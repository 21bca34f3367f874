"""Writes the files in which findings are used: machine file, calibration, extended model, effect file."""
