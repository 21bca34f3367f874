"""Tyre and machine parameters from raw measurements, with intervals, reasons for what was rejected and what stays undetermined."""
