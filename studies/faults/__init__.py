"""Faults of sensors: what size of which fault the ECU notices and names, computed and measured, and its false alarms."""
