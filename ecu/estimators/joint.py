"""A joint's angle with its cosine and sine, which many equations of one moment share."""

import math
from typing import NamedTuple

from ecu.estimators.compiled import compiled, inlined


class Joint(NamedTuple):
    """Angle of a joint: the articulation (left positive), or a pin of the linkage (up positive)."""

    angle: float  # [rad]
    cosine: float
    sine: float


@compiled
def joint_at(angle: float) -> Joint:
    """The joint at this angle [rad]."""
    return Joint(angle, math.cos(angle), math.sin(angle))


@inlined
def slight(angle: float) -> tuple[float, float]:
    """Cosine and sine of a slight angle [rad]: an exact rotation whose angle is right to angle^5 / 120.

    By the tangent of the half angle, with two terms of its series: a step of a prediction turns by 0.06 rad at most, and a
    microcontroller takes a hundred instructions for a sine.
    """
    half = angle / 2.0 * (1.0 + angle * angle / 12.0)
    square = half * half
    return (1.0 - square) / (1.0 + square), 2.0 * half / (1.0 + square)


@inlined
def turned(joint: Joint, angle: float) -> Joint:
    """The joint after a slight turn to this angle [rad]; accuracy as of `slight`."""
    c, s = slight(angle - joint.angle)
    return Joint(angle, joint.cosine * c - joint.sine * s, joint.sine * c + joint.cosine * s)
