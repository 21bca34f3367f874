"""XCP on CAN: measuring and calibrating the ECU while it runs (ASAM MCD-1 XCP 1.1, classic CAN)."""
