"""Detection and isolation of faults of the sensors, and the trouble codes they leave."""
