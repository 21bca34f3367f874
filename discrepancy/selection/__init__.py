"""The search for missing effects: score screen, candidate fits, active intervals, open-ended terms."""
