"""The bench: lockstep, processes, decoding, report and command line; composes everything."""
