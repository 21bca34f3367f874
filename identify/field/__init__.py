"""From motion capture and wheel transducers to a tyre."""
