"""Conformance of a controller against its DBC: requirements, the stimulus on a live bus, and the verdicts on its record."""
