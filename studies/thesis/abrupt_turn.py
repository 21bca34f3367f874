"""The abrupt turn that rolls the machine over, and when a load comes to zero in it."""

import math
from dataclasses import dataclass

from hil.verdict import first_lift_off
from studies.thesis.drive import Array

SPEED_KMH = 26.0
TURN_S = 2.0
RATE = math.radians(27.0)  # what the steering cylinders give [rad/s]
ANGLE = math.radians(39.0)
ROLLED = math.radians(45.0)


@dataclass(frozen=True, slots=True)
class Seen:
    """When and at which wheel an estimate comes to zero; infinite and none: never."""

    time: float = math.inf
    wheel: int | None = None


def seen(time: Array, force: Array) -> Seen:
    """The first lift-off in normal forces (n, 4) [N]."""
    found = first_lift_off(time, force)
    return Seen(*found) if found else Seen()
