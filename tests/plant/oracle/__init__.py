"""The loader once more, in an independent multibody engine."""
