"""Slope from an inclination sensor, freed of the accelerations that the sensor takes for a slope.

The sensor's gyro follows a change of slope at once, and its accelerometers correct the gyro with a time constant T. They feel
the machine's acceleration as well, so the reading is

    slope + lean,   T d(lean)/dt = (inclination that the accelerometers show - slope) - lean

The acceleration is known here from the fused speed and the yaw rate, so the same filter gives the lean, which is taken off.
Left out: lateral slip that changes, and the sensor's height in roll and pitch accelerations.
"""

import math
from typing import NamedTuple

from ecu.estimators.compiled import compiled
from ecu.estimators.parameters import GRAVITY


class Slope(NamedTuple):
    """Pitch, nose down positive, and roll, left side up positive, or errors of both [rad]."""

    pitch: float
    roll: float


class Lean(NamedTuple):
    """What accelerations add to the sensor's reading [rad], and the speed of the rear axle whose change is taken for acceleration [m/s]."""

    pitch: float
    roll: float
    speed: float


TRUST = 2.0
"""Rate at which that speed goes to that of the wheels [1/s]: quickly enough to damp what a wrong slope does to the fused speed."""
MOST_TRUST = 0.2
"""Most of that correction [m/s2]: beyond the zero errors of accelerometer and slope, and small beside the braking of locked wheels."""


@compiled
def followed_speed(before: float, change: float, wheels: float, dt: float) -> float:
    """That speed after a cycle in which the fused speed changed by `change`; wheels: the axle's speed by its wheels [m/s].

    The fused speed alone would confirm a wrong slope, from which it takes its own acceleration; wheels alone slip.
    """
    correction = min(max(TRUST * (wheels - before), -MOST_TRUST), MOST_TRUST)
    return before + change + correction * dt


@compiled
def apparent(slope: Slope, ahead: float, aside: float) -> Slope:
    """What accelerometers take for the slope of a machine on this slope that accelerates ahead and to the left [m/s2]."""
    across = math.cos(slope.pitch) * GRAVITY
    x, y = ahead - GRAVITY * math.sin(slope.pitch), aside + across * math.sin(slope.roll)
    z = across * math.cos(slope.roll)
    return Slope(math.atan2(-x, math.sqrt(y * y + z * z)), math.atan2(y, z))


@compiled
def without(reading: Slope, lean: Slope) -> Slope:
    """The slope of a reading."""
    return Slope(reading.pitch - lean.pitch, reading.roll - lean.roll)


@compiled
def leaned(lean: Slope, slope: Slope, ahead: float, aside: float, dt: float, time: float) -> Slope:
    """The lean after a cycle of `dt` [s] with these accelerations; time: T [s]."""
    felt, share = apparent(slope, ahead, aside), dt / (time + dt)
    return Slope(
        lean.pitch + share * (felt.pitch - slope.pitch - lean.pitch),
        lean.roll + share * (felt.roll - slope.roll - lean.roll),
    )


@compiled
def lean_at_start(aside: float) -> Slope:
    """The lean of a machine that has been turning evenly before the first cycle, or stands."""
    return apparent(Slope(0.0, 0.0), 0.0, aside)
