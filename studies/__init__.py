"""Answers made by many runs: campaigns, the thesis' open questions, machine standards, soak runs with the fault matrix."""
