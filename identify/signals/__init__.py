"""Signals of unsynchronised, damaged recordings: one time base, filters, clocks, axes. Functions over plain arrays."""
