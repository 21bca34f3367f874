"""Residual of the two pressures that carry arm and bucket, and what one of them means for the other."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.detection.compiled import compiled
from ecu.detection.layout import BUCKET_LOAD, F_COUPLE, F_DUG, F_PLACE, FILTERS, PAUSED, TREND
from ecu.detection.machine import NOTHING, follow
from ecu.detection.motion import Motion
from ecu.detection_rules import Tolerances
from ecu.estimators.loads.cog import rotated
from ecu.estimators.loads.linkage import levers, pushes
from ecu.estimators.parameters import GRAVITY, Parameters
from ecu.watched import ANGLE, ARM, BUCKET, FORCE, LIFT, TILT

Floats = NDArray[np.float64]

STIRRING = 0.002
"""Move of the arm per sample above which its pressures accelerate it as well [rad]."""
REMEMBERED = 2.0
"""Time constant with which the payload's place is remembered [s]."""
LEARNING = 0.3
"""Time constant with which the place of what was dug is learned [s]."""
UNEVEN = 0.15
"""How far in front of the edge or behind the pin a heap's centre of gravity may seem to lie [m]."""
LIGHT = 200.0
"""Payload below which its place does not matter [kg]."""
EMPTY = 5e4
"""Pressure below which a head side carries nothing [Pa]."""


@compiled
def payload_of(m: Floats, p: Parameters) -> float:
    """Payload by the lift pressure alone, as of a machine that stands [kg]: good enough for a mass."""
    lifting = m[LIFT] * p.cylinders.head_area - p.cylinders.back_pressure * p.cylinders.rod_area
    ahead = p.arm.length * math.cos(m[ARM])
    own = p.arm.mass * p.arm.along * math.cos(m[ARM]) + p.bucket.mass * ahead
    return (lifting * 0.45 - own * GRAVITY) / (ahead * GRAVITY)


class Balance(NamedTuple):
    """Moments on arm and bucket: constant part, per pascal of each pressure, and per kilogram of payload.

    The estimators' own balances (`ecu.estimators.loads.payload`) with the specific force as measured.
    """

    arm: float  # about the arm's pivot less about the bucket's pin [N m]
    arm_lift: float  # per lift pressure [m3]
    arm_tilt: float
    arm_load: float  # per payload [N m/kg]
    pin: float  # about the bucket's pin [N m]
    pin_tilt: float
    pin_load: float


@compiled
def balance_of(m: Floats, p: Parameters) -> Balance:
    """The balances at the present pose."""
    lever = levers(m[ARM], m[BUCKET], p.arm, p.bucket, p.cylinders, p.tilt_linkage)
    lifting, tilting = pushes(0.0, 0.0, p.cylinders, p.tilt_linkage)
    fx, fz = m[FORCE], m[FORCE + 2]
    ax, az = rotated(p.arm.along, p.arm.above, m[ARM])
    px, pz = rotated(p.arm.length, 0.0, m[ARM])
    bx, bz = rotated(p.bucket.forward, p.bucket.above, m[BUCKET] - p.bucket.carried)
    lx, lz = rotated(p.bucket.payload_forward, p.bucket.payload_above, m[BUCKET] - p.bucket.carried)
    own = p.arm.mass * (ax * fz - az * fx) + p.bucket.mass * (px * fz - pz * fx)
    on_arm = lever.tilt_on_arm - lever.tilt_on_bucket
    return Balance(
        lifting * lever.lift + tilting * on_arm - own,
        lever.lift * p.cylinders.head_area,
        on_arm * p.tilt_linkage.head_area,
        px * fz - pz * fx,
        tilting * lever.tilt_on_bucket - p.bucket.mass * (bx * fz - bz * fx),
        lever.tilt_on_bucket * p.tilt_linkage.head_area,
        lx * fz - lz * fx,
    )


@compiled
def bucket(
    m: Floats,
    q: Motion,
    digging: bool,
    p: Parameters,
    t: Tolerances,
    state: Floats,
    dt: float,
    r: Floats,
    bound: Floats,
) -> None:
    """Where the payload lies by both pressures, against where it has to lie [N m about the bucket's pin]."""
    b = balance_of(m, p)
    payload = (b.arm + b.arm_lift * m[LIFT] + b.arm_tilt * m[TILT]) / b.arm_load
    heavy = max(payload, 0.0)
    place = b.pin + b.pin_tilt * m[TILT] - payload * b.pin_load
    r[BUCKET_LOAD] = place - heavy * GRAVITY * state[FILTERS, F_PLACE]
    bound[BUCKET_LOAD] += (heavy * (t.centre + t.mass) + p.bucket.mass * t.centre) * GRAVITY
    bound[BUCKET_LOAD] += abs(payload) * 0.1 * GRAVITY
    # the bucket is ahead of the inertial sensor and feels the pitching of the machine and the other share of a turn
    reach = p.geometry.front_length + p.arm.length - p.sensors.imu_x
    beside = q.pitch * reach + q.upright + q.ahead
    beside += abs(m[FORCE]) * (1.0 - math.cos(m[ANGLE])) + abs(m[FORCE + 1] * math.sin(m[ANGLE]))
    arms = abs(b.pin_load) * (p.arm.mass + p.bucket.mass + heavy) * p.arm.length / abs(b.arm_load)
    arms += (p.bucket.mass * p.bucket.forward + heavy * p.bucket.payload_forward) * 1.0
    bound[BUCKET_LOAD] += beside * arms
    # pressures that move are of another time, and accelerate arm and bucket
    bound[BUCKET_LOAD] += abs(b.pin_tilt - b.pin_load * b.arm_tilt / b.arm_load) * q.tilting
    bound[BUCKET_LOAD] += abs(b.pin_load * b.arm_lift / b.arm_load) * q.lifting
    moving = abs(state[TREND, ARM]) > STIRRING or abs(state[TREND, BUCKET]) > STIRRING
    if digging:
        state[FILTERS, F_DUG] = 1.0
    if state[FILTERS, F_DUG] != 0.0 and not digging:
        learned(place, heavy, p, state, dt)
    if digging or moving or m[TILT] < EMPTY or m[LIFT] < EMPTY:
        bound[BUCKET_LOAD] = NOTHING
    elif abs(r[BUCKET_LOAD]) < bound[BUCKET_LOAD]:
        follow(state, F_COUPLE, place, dt / (REMEMBERED + dt))


@compiled
def learned(couple: float, payload: float, p: Parameters, state: Floats, dt: float) -> None:
    """After digging the heap lies anywhere in the bucket: learn where, until the residual says something again."""
    deepest = p.digging.edge_forward - p.bucket.payload_forward + UNEVEN
    found = couple / (max(payload, LIGHT) * GRAVITY)
    follow(state, F_PLACE, min(max(found, -deepest), deepest), dt / (LEARNING + dt))
    if state[PAUSED, BUCKET_LOAD] <= 0.0:
        state[FILTERS, F_DUG] = 0.0


@compiled
def pressure_from_other(m: Floats, missing: int, couple: float, p: Parameters) -> float:
    """The pressure `missing` (LIFT or TILT) that the other one means, for a payload that lies where it lay [Pa].

    couple: of the payload about the bucket's pin while both were sound [N m]. The other pressure itself where its
    balance does not depend on the missing one.
    """
    b = balance_of(m, p)
    if missing == TILT:  # two balances, unknown payload and tilt pressure
        free = b.arm + b.arm_lift * m[LIFT]
        base = b.pin_tilt - b.arm_tilt * b.pin_load / b.arm_load
        found = (couple - b.pin + free * b.pin_load / b.arm_load) / base if abs(base) > 1e-6 else m[TILT]
    else:
        payload = (b.pin + b.pin_tilt * m[TILT] - couple) / b.pin_load if abs(b.pin_load) > 1.0 else 0.0
        found = (payload * b.arm_load - b.arm - b.arm_tilt * m[TILT]) / b.arm_lift
    return max(found, 0.0)
