"""Residuals of the wheels' speeds, and of the yaw rate that they and the joint give."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.detection.bucket import payload_of
from ecu.detection.compiled import compiled
from ecu.detection.layout import SPEEDS, YAW_STEERING
from ecu.detection.machine import STANDING, effective_radius, machine_mass, sunk
from ecu.detection.motion import Motion, slip_of
from ecu.detection_rules import Tolerances
from ecu.estimators.parameters import GRAVITY, Parameters
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
def standing_loads(payload: float, p: Parameters) -> tuple[float, float]:
    """Load of a front and of a rear wheel of the standing machine with so much payload [kg], in [N]."""
    base = p.geometry.front_length + p.geometry.rear_length
    reach = p.arm.pivot_x + 0.8 * p.arm.length + p.geometry.rear_length
    ahead = p.front.mass * (p.front.x + p.geometry.rear_length)
    ahead += p.arm.mass * (p.arm.pivot_x + 0.8 * p.arm.along + p.geometry.rear_length)
    ahead += p.rear.mass * (p.rear.x + p.geometry.rear_length)
    ahead += (p.bucket.mass + max(payload, 0.0)) * (reach + p.bucket.forward)
    front = ahead / base
    rear = max(machine_mass(p) + max(payload, 0.0) - front, 0.15 * machine_mass(p))
    return front * GRAVITY / 2.0, rear * GRAVITY / 2.0


@compiled
def turning_shares(payload: float, p: Parameters) -> tuple[float, float]:
    """Lateral force over load of the front and of the rear axle, per yaw acceleration of the straight machine [1/(rad/s2)].

    Two axles turn the machine as a couple; the lighter of them uses more of its grip for it. payload: [kg].
    """
    arm, bucket, rear, g = p.arm, p.bucket, p.rear, p.geometry
    reach, load = arm.pivot_x + 0.8 * arm.length, max(payload, 0.0)
    boom = arm.pivot_x + 0.8 * arm.along
    mass = machine_mass(p) + load
    tips = bucket.mass + load
    first = p.front.mass * p.front.x + arm.mass * boom + tips * (reach + bucket.forward)
    first += rear.mass * rear.x - p.axle.mass * g.rear_length
    second = p.front.mass * p.front.x**2 + arm.mass * boom**2 + tips * (reach + bucket.forward) ** 2
    second += rear.mass * rear.x**2 + p.axle.mass * g.rear_length**2
    own = p.front.yaw_inertia + arm.yaw_inertia + bucket.yaw_inertia + rear.yaw_inertia
    own += p.axle.roll_inertia  # that of a slender axle about z
    about = own + load * bucket.payload_yaw_gyration**2 + second - first * first / mass
    couple = about / (g.front_length + g.rear_length)
    front, behind = standing_loads(payload, p)
    return couple / (2.0 * front), couple / (2.0 * behind)


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
    """Sideways speed of the axles, at most, that the wheels of the other, turned unit take for speed ahead [m/s]; angle: of the joint [rad]."""
    return abs(speed) * q.sideslip * abs(math.tan(angle))


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
    stiffness = p.wheel.cornering_stiffness * (1.0 - t.stiffness)
    front, rear = turning_shares(payload_of(m, p), p)
    slipping = slip_of(q.side + front * q.yaw, stiffness) + slip_of(q.side + rear * q.yaw, stiffness)
    expected = (w.middle * math.sin(m[ANGLE]) - g.front_length * m[RATE]) / long
    unsure = max(speed_bound(w.front, w.middle, q, p, t), speed_bound(w.rear, w.middle, q, p, t))
    r[YAW_STEERING] = expected - m[YAW_RATE]
    bound[YAW_STEERING] += (abs(math.sin(m[ANGLE])) * unsure + abs(w.middle) * slipping) / long
    bound[YAW_STEERING] += t.gain * (abs(m[YAW_RATE]) + abs(m[RATE])) + t.time * (q.yaw + q.joint)
    bound[YAW_STEERING] += abs(w.middle) * t.time * abs(m[RATE]) / long
    # the unit turns as its tyres' give lets it
    bound[YAW_STEERING] += COMPLIANCE * q.joint * g.front_length / long * 0.5
