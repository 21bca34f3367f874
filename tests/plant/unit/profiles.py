"""Reads a profile of a script, as the compiled tick reads it."""

from plant.unit.profile import Profile, curves_of, value_at


def value(profile: Profile, time: float) -> float:
    """Of a profile at a time [s]; others stand before it."""
    return value_at(curves_of([Profile(((0.0, 99.0), (1.0, 98.0))), None, profile]), 2, time)
