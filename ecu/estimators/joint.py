"""The articulation joint's angle with its cosine and sine, which many equations of one moment share."""

import math
from typing import NamedTuple

from ecu.estimators.compiled import compiled


class Joint(NamedTuple):
    """Articulation angle, left positive. A microcontroller takes a hundred instructions for a sine: it is taken once."""

    angle: float  # [rad]
    cosine: float
    sine: float


@compiled
def joint_at(angle: float) -> Joint:
    """The joint at this angle [rad]."""
    return Joint(angle, math.cos(angle), math.sin(angle))
