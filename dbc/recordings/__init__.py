"""Recordings of frames read into columns: candump logs, BLF and MF4."""
