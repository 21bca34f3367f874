"""Estimators: pure functions of floats, one source for the live loop, columns and C."""
