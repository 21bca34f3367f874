"""What every process of the bench needs at its edge: its link to the supervisor, signals, real-time options, one-line errors."""
