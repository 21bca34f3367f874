"""C99 of the ECU for microcontrollers, written from the Python source of estimators and limits (docs/adr/0032-c-from-python.md)."""
