"""From logs of a chassis dynamometer to a tyre."""
