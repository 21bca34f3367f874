"""The bench as a test system: pass criteria of a run, and what is concluded from it. It judges what `hil` runs."""
