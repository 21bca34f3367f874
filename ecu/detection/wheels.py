"""Residuals of the wheels' speeds, and of the yaw rate that they and the joint give."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.detection.bucket import payload_of
from ecu.detection.compiled import compiled
from ecu.detection.layout import SPEEDS, YAW_STEERING
from ecu.detection.machine import STANDING, effective_radius, standing_loads, sunk
from ecu.detection.motion import Motion, slip_of
from ecu.detection_rules import Tolerances
from ecu.estimators.parameters import Parameters
from ecu.watched import ANGLE, RATE, TORQUE, WHEEL, YAW_RATE

Floats = NDArray[np.float64]

SCRUB = 0.05
"""How much a wheel's speed over ground differs from its place's, per yaw rate, by its width and the tyres' give [m]."""
COMPLIANCE = 0.15
"""Time in which the tyres' sideways give lets the machine follow its joint [s]."""
LOAD_UNKNOWN = 0.3
"""Share of a wheel's load that its place in the machine and the ground's unevenness leave open."""


class Wheels(NamedTuple):
    """Speed of the rear axle as each wheel has it, and how much of its grip each uses."""

    v1: float  # [m/s]
    v2: float
    v3: float
    v4: float
    middle: float  # median
    front: float  # largest traction of a front wheel over its load
    rear: float
    used: float  # the larger of them


@compiled
def wheel_speeds(m: Floats, p: Parameters) -> Wheels:
    """The four readings, corrected for turning and for the expected slip."""
    g, w = p.geometry, p.wheel
    yaw, radius = m[YAW_RATE], effective_radius(p)
    c, s = math.cos(m[ANGLE]), math.sin(m[ANGLE])
    front_yaw = yaw + m[RATE]
    front_load, rear_load = standing_loads(payload_of(m, p), p)
    k1, k2 = m[TORQUE] / radius / front_load, m[TORQUE + 1] / radius / front_load
    k3, k4 = m[TORQUE + 2] / radius / rear_load, m[TORQUE + 3] / radius / rear_load
    front, rear = max(abs(k1), abs(k2)), max(abs(k3), abs(k4))
    if min(abs(m[WHEEL]), abs(m[WHEEL + 1])) < STANDING:
        front = 1.0
    if min(abs(m[WHEEL + 2]), abs(m[WHEEL + 3])) < STANDING:
        rear = 1.0
    half_front, half_rear = g.front_track / 2.0, g.rear_track / 2.0
    # the joint's speed along the rear unit, seen from the front axle
    side = yaw * g.rear_length * s
    v1 = (m[WHEEL] * radius * rolled(k1, w.slip_stiffness) + front_yaw * half_front - side) / c
    v2 = (m[WHEEL + 1] * radius * rolled(k2, w.slip_stiffness) - front_yaw * half_front - side) / c
    v3 = m[WHEEL + 2] * radius * rolled(k3, w.slip_stiffness) + yaw * half_rear
    v4 = m[WHEEL + 3] * radius * rolled(k4, w.slip_stiffness) - yaw * half_rear
    low, high = min(min(v1, v2), min(v3, v4)), max(max(v1, v2), max(v3, v4))
    return Wheels(v1, v2, v3, v4, (v1 + v2 + v3 + v4 - low - high) / 2.0, front, rear, max(front, rear))


@compiled
def rolled(used: float, stiffness: float) -> float:
    """Way over turned angle times radius of a tyre that pulls with so much of its load."""
    return 1.0 - used / stiffness


@compiled
def speed_bound(used: float, speed: float, q: Motion, p: Parameters, t: Tolerances) -> float:
    """How wrong the speed by one wheel may be [m/s], beside turning: radius, slip, time."""
    w = p.wheel
    # the effective radius shrinks by a third of the deflection, which goes with the load: (112)
    radius = t.radius + sunk(p) / 3.0 * (q.moved + LOAD_UNKNOWN)
    # the same traction on a wheel that others have relieved, of tyres that also hold the machine sideways
    most = slip_of(math.hypot(used / (1.0 - q.moved), q.side), w.slip_stiffness * (1.0 - t.stiffness))
    pull = used / max(math.hypot(used / (1.0 - q.moved), q.side), 1e-9) / (1.0 - q.moved)
    slip = max(most * pull - used / w.slip_stiffness, used / w.slip_stiffness * t.stiffness)
    # slip follows traction later: torques and speeds are of different times, tyres relax, wheels take torque to turn faster
    turning = w.spin_inertia * q.speed / (w.unloaded_radius * w.unloaded_radius * w.nominal_load)
    slip += (q.grip + turning) / (w.slip_stiffness * (1.0 - t.stiffness))
    return abs(speed) * (radius + slip) + t.time * q.speed


@compiled
def drift(angle: float, speed: float, q: Motion) -> float:
    """Sideways speed of the rear axle, at most, that the wheels of the turned front unit take for speed ahead [m/s]; angle: of the joint [rad]."""
    return abs(speed) * q.rear_slip * abs(math.tan(angle))


@compiled
def speed_pairs(
    m: Floats, w: Wheels, q: Motion, p: Parameters, t: Tolerances, r: Floats, bound: Floats
) -> None:
    """The rear axle's speed as every two wheels have it."""
    g = p.geometry
    yaw, rate = abs(m[YAW_RATE]), abs(m[RATE])
    tangent = abs(math.tan(m[ANGLE]))
    front = speed_bound(w.front, w.middle, q, p, t)
    rear = speed_bound(w.rear, w.middle, q, p, t)
    # across the track: what the gyros scale wrongly, of another time, and where on its width a tyre rolls
    turned = g.rear_track / 2.0 * (t.gain * yaw + t.time * q.yaw) + SCRUB * yaw
    rear += turned
    front += turned + g.front_track / 2.0 * (t.gain * rate + t.time * q.joint) + SCRUB * rate
    between = drift(m[ANGLE], w.middle, q)
    between += g.rear_length * tangent * (t.gain * yaw + t.time * q.yaw)
    between += abs(w.middle) * tangent * t.time * rate
    r[SPEEDS], r[SPEEDS + 1], r[SPEEDS + 2] = w.v1 - w.v2, w.v1 - w.v3, w.v1 - w.v4
    r[SPEEDS + 3], r[SPEEDS + 4], r[SPEEDS + 5] = w.v2 - w.v3, w.v2 - w.v4, w.v3 - w.v4
    bound[SPEEDS] += 2.0 * front
    bound[SPEEDS + 5] += 2.0 * rear
    for k in range(SPEEDS + 1, SPEEDS + 5):
        bound[k] += front + rear + between


@compiled
def yaw_by_steering(
    m: Floats, w: Wheels, q: Motion, p: Parameters, t: Tolerances, r: Floats, bound: Floats
) -> None:
    """Yaw rate by speed and articulation, for axles that do not slip sideways, against the gyro's."""
    g = p.geometry
    long = g.front_length + g.rear_length * math.cos(m[ANGLE])
    expected = (w.middle * math.sin(m[ANGLE]) - g.front_length * m[RATE]) / long
    unsure = max(speed_bound(w.front, w.middle, q, p, t), speed_bound(w.rear, w.middle, q, p, t))
    r[YAW_STEERING] = expected - m[YAW_RATE]
    bound[YAW_STEERING] += (
        abs(math.sin(m[ANGLE])) * unsure + abs(w.middle) * (q.front_slip + q.rear_slip)
    ) / long
    bound[YAW_STEERING] += t.gain * (abs(m[YAW_RATE]) + abs(m[RATE])) + t.time * (q.yaw + q.joint)
    bound[YAW_STEERING] += abs(w.middle) * t.time * abs(m[RATE]) / long
    # the unit turns as its tyres' give lets it
    bound[YAW_STEERING] += COMPLIANCE * q.joint * g.front_length / long * 0.5
