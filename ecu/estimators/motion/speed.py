"""Speed of the rear axle from four wheels and the inertial sensor.

Each wheel gives a reading of the axle's speed after its own kinematics and the slip that its force
needs. The inertial sensor carries the speed from sample to sample; a wheel far from it (locked,
spinning) loses its influence, and regains it when it agrees again. While no wheel has influence the speed may drift away:
the *doubt* says how far.
"""

import math
from typing import NamedTuple

from ecu.estimators.compiled import compiled
from ecu.estimators.parameters import Geometry

CONSENSUS = 0.2
"""Least influence of a wheel while all four agree and roll."""
DRIFT = 0.12
"""Acceleration towards the wheels, whatever their influence [m/s2], full from 1 m/s on: beyond the zero errors of accelerometer and slope."""
ROLLING = 0.5
"""Below this speed [m/s] agreeing wheels may all be locked."""
LEANING = 0.8
"""Error of the acceleration along the ground while no wheel has influence [m/s2]: the slope sensor's lean is then computed from a
speed that nothing proves, and confirms it. It is 0.4 to 0.85 while all wheels are locked, on level ground and downhill."""
SLIDING = 1.0
"""A machine whose wheels slide comes to their speed at least so fast [m/s2]: a tenth of its weight as friction."""
DOUBT_MOST = 20.0
"""The doubt grows no further [m/s]: more than the machine's largest speed."""


class Fused(NamedTuple):
    """Speed of the rear axle, and by how much it may be wrong because wheels slide [m/s]."""

    speed: float
    doubt: float


@compiled
def front_wheel_reading(
    rolling: float,
    slip: float,
    side: float,
    articulation_angle: float,
    yaw_rate: float,
    articulation_rate: float,
    geometry: Geometry,
) -> float:
    """Speed of the rear axle [m/s] by a front wheel with circumferential speed `rolling` [m/s].

    side: +1 for the left wheel, -1 for the right one; slip: as expected from its force.
    """
    along = rolling / (1.0 + slip) + side * geometry.front_track / 2.0 * (yaw_rate + articulation_rate)
    lateral = geometry.rear_length * yaw_rate * math.sin(articulation_angle)
    return (along - lateral) / math.cos(articulation_angle)


@compiled
def rear_wheel_reading(
    rolling: float, slip: float, side: float, yaw_rate: float, geometry: Geometry
) -> float:
    """Speed of the rear axle [m/s] by a rear wheel; arguments as for the front wheel."""
    return rolling / (1.0 + slip) + side * geometry.rear_track / 2.0 * yaw_rate


@compiled
def doubt_carried(before: float, weight: float, unproven: float, gain: float, dt: float) -> float:
    """The doubt [m/s] of a speed that the inertial sensor carries.

    before: a cycle earlier; weight: mean influence of the wheels, 0 to 1; unproven: change of the speed in this cycle for which no wheel
    has influence [m/s]; gain: share of the wheels' innovation taken over. Where no wheel has influence the errors of the acceleration add up.
    """
    error = DRIFT + (LEANING - DRIFT) * (1.0 - weight)
    return min((before + error * dt + abs(unproven)) / (1.0 + gain * weight), DOUBT_MOST)


@compiled
def doubt_of_wheels(before: float, change: float, most: float, dt: float) -> float:
    """The doubt [m/s] of a speed that the wheels alone give.

    change: of the speed in this cycle [m/s]; most: what the tyres' grip can change it by [m/s]. Wheels whose speed changes faster slide.
    """
    return min(max(before + max(abs(change) - most, 0.0) - SLIDING * dt, 0.0), DOUBT_MOST)


@compiled
def influence(innovation: float, scatter: float) -> float:
    """Weight of a reading that is `innovation` [m/s] off: 1 inside the scatter, falling beyond."""
    ratio = innovation / scatter
    return 1.0 / (1.0 + ratio * ratio * ratio * ratio)
