"""A small translator from the Python subset of the estimators to C (docs/adr/0032-c-from-python.md)."""
