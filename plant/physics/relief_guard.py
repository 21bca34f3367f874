"""Bounds of the driven joints' efforts within which no relief valve can open, at any position of the joints.

The bounds follow from the smallest moment arms of the cylinders within their strokes. A machine is within them most of the time;
plant.physics.relief then need not compute the moment arms, which costs more than the comparison.
"""

import math
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plant.compiled import compiled
from plant.physics.linkage import (
    K_LIFT_BACK,
    K_LIFT_HEAD,
    K_LIFT_ROD,
    K_TILT_BACK,
    K_TILT_HEAD,
    K_TILT_ROD,
    LINKAGE,
    lift_cylinder,
    tilt_cylinder,
)
from plant.physics.steering import S_BACK, torques_per_pressure

Array = NDArray[np.float64]

G_STROKES: Final = 0  # least and greatest angle of joint, arm and bucket [rad] that the bounds hold for
G_STEERING: Final = 6  # torque of the joint, in either direction [N m]
G_TILT: Final = 7  # least and greatest torque of the bucket [N m]
G_LIFT: Final = 9  # least and greatest torque of the arm [N m], its share in carrying the bucket's added
G_COUPLING: Final = 11  # that share, at most: torque of the arm per torque of the bucket
GUARD: Final = 12

POINTS: Final = 65  # positions of each stroke at which the moment arms are computed
BETWEEN: Final = (
    0.99  # share of the smallest moment arm at these positions: between them it may be slightly smaller
)


def guard_of(strokes: Array, relief: Array, linkage: Array, cylinders: Array) -> Array:
    """Bounds (GUARD,) that hold within strokes (3, 2) [rad] at relief pressures (3,) [Pa], both of steering, lift and tilt.

    linkage, cylinders: of plant.physics.linkage and plant.physics.steering. Not numbers where an arm of the linkage changes its sign.
    """
    return _kept(np.concatenate((strokes.ravel(), relief, linkage, cylinders)).tobytes())


@lru_cache(maxsize=64)
def _kept(given: bytes) -> Array:
    strokes, relief, linkage, cylinders = np.split(np.frombuffer(given), (6, 9, 9 + LINKAGE))
    steering, lift, tilt = (np.linspace(low, high, POINTS) for low, high in strokes.reshape(3, 2))
    return np.array((*strokes, *bounds(steering, lift, tilt, relief, linkage, cylinders)))


@compiled
def bounds(
    steering: Array, lift: Array, tilt: Array, relief: Array, k: Array, cylinders: Array
) -> tuple[float, float, float, float, float, float]:
    """What follows the strokes in the guard, for what these angles [rad] show."""
    back, turning = cylinders[S_BACK], math.inf
    for angle in steering:
        to_left, to_right = torques_per_pressure(cylinders, angle)
        turning = least(turning, relief[0] * to_left - back * to_right)
        turning = least(turning, relief[0] * to_right - back * to_left)
    lifting, tilting, coupling = math.inf, math.inf, 0.0
    for arm in lift:
        lifting = least(lifting, lift_cylinder(k, arm)[1])
        for bucket in tilt:
            _, on_bucket, on_arm = tilt_cylinder(k, arm, bucket)
            tilting = least(tilting, on_bucket)
            coupling = max(coupling, abs(on_arm / on_bucket))
    lifting, tilting = BETWEEN * lifting, BETWEEN * tilting
    return (
        BETWEEN * turning,
        -relief[2] * k[K_TILT_ROD] * tilting,
        (relief[2] * k[K_TILT_HEAD] - k[K_TILT_BACK] * k[K_TILT_ROD]) * tilting,
        -relief[1] * k[K_LIFT_ROD] * lifting,
        (relief[1] * k[K_LIFT_HEAD] - k[K_LIFT_BACK] * k[K_LIFT_ROD]) * lifting,
        coupling / BETWEEN,
    )


@compiled
def least(before: float, value: float) -> float:
    """The smaller one; not a number from the first value on that is not above zero."""
    return math.nan if math.isnan(before) or not value > 0.0 else min(before, value)
