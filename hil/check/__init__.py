"""Deadline checks of a recording or a run directory, for `loaderhil check` and the verdict of a real-time run."""
