"""Roll-over by the present loads (thesis 2.4.5): a wheel is watched until its load is gone; no prediction."""

from typing import NamedTuple

from ecu.estimators.compiled import compiled
from ecu.estimators.quantities import NormalForces


class PrintedMargin(NamedTuple):
    """Smallest normal force over its standing value, and its wheel (1 FL, 2 FR, 3 RL, 4 RR)."""

    ratio: float
    wheel: float


@compiled
def four_wheel_load_transfer(forces: NormalForces) -> float:
    """(right - left) / sum of the four normal forces; right side heavier +."""
    left = forces.front_left + forces.rear_left
    right = forces.front_right + forces.rear_right
    return (right - left) / (right + left)


@compiled
def front_load_transfer(forces: NormalForces) -> float:
    """(right - left) / sum of the two front normal forces; a pull counts as no load, and 0 where neither carries anything."""
    left, right = max(forces.front_left, 0.0), max(forces.front_right, 0.0)
    return (right - left) / (right + left) if right + left > 0.0 else 0.0


@compiled
def printed_margin(forces: NormalForces, standing: NormalForces) -> PrintedMargin:
    """Smallest of the four forces relative to the straight machine standing on level ground."""
    ratio = forces.front_left / standing.front_left
    wheel = 1.0
    other = forces.front_right / standing.front_right
    if other < ratio:
        ratio, wheel = other, 2.0
    other = forces.rear_left / standing.rear_left
    if other < ratio:
        ratio, wheel = other, 3.0
    other = forces.rear_right / standing.rear_right
    if other < ratio:
        ratio, wheel = other, 4.0
    return PrintedMargin(ratio, wheel)
