"""Motion by the wheels alone, as thesis 2.5 has it: the mean of four wheels, no centripetal acceleration (E-18)."""

import math

from ecu.estimators.compiled import compiled
from ecu.estimators.parameters import Geometry


@compiled
def printed_acceleration(acceleration: float, articulation_angle: float) -> tuple[float, float]:
    """v'_x = v' cos(delta/2), v'_y = v' sin(delta/2) as printed (unnumbered, 2.5): the speed's
    derivative projected on the joint's direction, without centripetal acceleration. y as delta."""
    half = articulation_angle / 2.0
    return acceleration * math.cos(half), acceleration * math.sin(half)


@compiled
def wheel_acceleration(before: float, now: float, filtered: float, dt: float, time: float) -> float:
    """Angular acceleration of a wheel [rad/s2], through a first-order filter of time constant `time` [s]."""
    return filtered + ((now - before) / dt - filtered) * dt / (time + dt)


@compiled
def yaw_rate_of_angle(speed: float, articulation_angle: float, geometry: Geometry) -> float:
    """Yaw rate [rad/s] of a machine that rolls with this speed [m/s] at a constant articulation angle."""
    lf, lr = geometry.front_length, geometry.rear_length
    return speed * math.sin(articulation_angle) / (lf + lr * math.cos(articulation_angle))
