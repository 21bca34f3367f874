"""Speed of the rear axle from four wheels and the inertial sensor.

Each wheel gives a reading of the axle's speed after its own kinematics and the slip that its force
needs. The inertial sensor carries the speed from sample to sample; a wheel far from it (locked,
spinning) loses its influence, and regains it when it agrees again.
"""

import math

from ecu.estimators.compiled import compiled
from ecu.estimators.parameters import Geometry

CONSENSUS = 0.2
"""Least influence of a wheel while all four agree and roll."""
DRIFT = 0.12
"""Acceleration towards the wheels, whatever their influence [m/s2], full from 1 m/s on: beyond the zero errors of accelerometer and slope."""
ROLLING = 0.5
"""Below this speed [m/s] agreeing wheels may all be locked."""


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
def influence(innovation: float, scatter: float) -> float:
    """Weight of a reading that is `innovation` [m/s] off: 1 inside the scatter, falling beyond."""
    ratio = innovation / scatter
    return 1.0 / (1.0 + ratio * ratio * ratio * ratio)
