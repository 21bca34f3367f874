"""The ECU's description for measuring and calibrating tools: ASAM MCD-2 MC (A2L)."""
