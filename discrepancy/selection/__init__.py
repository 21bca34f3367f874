"""The search for effects that the data ask for: score screen, candidate fits, amplitude_names intervals, open-ended terms."""
