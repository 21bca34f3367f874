"""Residuals: what two or more signals say of the same thing, subtracted; zero without a fault, up to noise and tolerance.

Each has a bound that follows from the uncertainty of masses, radii, stiffness and centres of gravity at the present
speed, torque and turn (adaptive threshold). A residual that says nothing at present has the bound NOTHING.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.detection.compiled import compiled
from ecu.detection.layout import (
    ACROSS,
    ALONG,
    ANGLE_RATE,
    BUCKET_LOAD,
    F_ACCELERATION,
    F_ACROSS,
    F_ALONG,
    F_ANGLE,
    F_COUPLE,
    F_CYCLES,
    F_PITCH,
    F_ROLL,
    F_SPEED,
    F_UP,
    FILTERS,
    FRONT_TORQUES,
    PITCH_GYRO,
    PITCH_RATES,
    ROLL_GYRO,
    SPEEDS,
    STEERING_LINES,
    TOLERANCE,
    TRACTION,
    TREND,
    UPWARDS,
    YAW_STEERING,
)  # fmt: skip
from ecu.detection_rules import Tolerances
from ecu.estimators.loads.cog import rotated
from ecu.estimators.loads.linkage import levers, pushes
from ecu.estimators.parameters import GRAVITY, Parameters
from ecu.watched import (
    ANGLE,
    ARM,
    BUCKET,
    FORCE,
    LEFT_LINE,
    LIFT,
    PITCH,
    PITCH_RATE,
    RATE,
    RIGHT_LINE,
    ROLL,
    ROLL_RATE,
    SLOPE_RATE,
    TILT,
    TORQUE,
    WHEEL,
    YAW_RATE,
)  # fmt: skip

Floats = NDArray[np.float64]

NOTHING = 1e30
OBSERVED = 1.0
"""Time in which an angle's observer forgets [s]."""
QUICK, SLOW = 0.05, 0.3
"""Time constants of the speed's derivative and of the accelerations [s]."""
GRIP = 0.25
"""Share of the load from which on a tyre's slip is not known: it may spin or lock on a slippery road."""
ROLLING = 0.5
"""Speed below which wheels may be held by their brakes [m/s]."""
SCRUB = 0.05
"""How much a wheel's speed over ground differs from its place's, per yaw rate, by its width and the tyres' give [m]."""
STIRRING = 0.002
"""Move of the arm per sample above which its pressures accelerate it as well [rad]."""
REMEMBERED = 2.0
"""Time constant with which the payload's place is remembered [s]."""
EMPTY = 5e4
"""Pressure below which a head side carries nothing [Pa]."""


class Wheels(NamedTuple):
    """Speed of the rear axle as each wheel has it, its uncertainty, and how much of its grip each uses."""

    v1: float  # [m/s]
    v2: float
    v3: float
    v4: float
    middle: float  # median
    slip: float  # largest expected slip
    used: float  # largest traction over load


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
    most = max(max(abs(k1), abs(k2)), max(abs(k3), abs(k4)))
    stiffness = w.slip_stiffness
    half_front, half_rear = g.front_track / 2.0, g.rear_track / 2.0
    v1 = (m[WHEEL] * radius * (1.0 - k1 / stiffness) + front_yaw * half_front - yaw * g.rear_length * s) / c
    v2 = (
        m[WHEEL + 1] * radius * (1.0 - k2 / stiffness) - front_yaw * half_front - yaw * g.rear_length * s
    ) / c
    v3 = m[WHEEL + 2] * radius * (1.0 - k3 / stiffness) + yaw * half_rear
    v4 = m[WHEEL + 3] * radius * (1.0 - k4 / stiffness) - yaw * half_rear
    low, high = min(min(v1, v2), min(v3, v4)), max(max(v1, v2), max(v3, v4))
    return Wheels(v1, v2, v3, v4, (v1 + v2 + v3 + v4 - low - high) / 2.0, most / stiffness, most)


@compiled
def effective_radius(p: Parameters) -> float:
    """Effective radius of a wheel at its nominal load [m]: (112) to first order, R0 - rho / 3."""
    w = p.wheel
    linear = w.radial_linear
    share = (math.sqrt(linear * linear + 4.0 * w.radial_quadratic) - linear) / (2.0 * w.radial_quadratic)
    return w.unloaded_radius * (1.0 - share / 3.0)


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
def machine_mass(p: Parameters) -> float:
    """Mass of the empty machine [kg]."""
    return p.front.mass + p.arm.mass + p.bucket.mass + p.rear.mass + p.axle.mass


@compiled
def follow(state: Floats, place: int, value: float, share: float) -> float:
    """A first-order filter kept in the state."""
    state[FILTERS, place] += share * (value - state[FILTERS, place])
    return state[FILTERS, place]


@compiled
def residuals(
    m: Floats, p: Parameters, t: Tolerances, rules: Floats, state: Floats, dt: float, r: Floats, bound: Floats
) -> None:
    """All residuals into `r` and their bounds into `bound`, both (RESIDUALS,)."""
    started = state[FILTERS, F_CYCLES] > 0.0
    state[FILTERS, F_CYCLES] += 1.0
    bound[:] = rules[TOLERANCE, : bound.size]
    angles(m, state, dt, started, r)
    w = wheel_speeds(m, p)
    speed_pairs(m, w, t, r, bound)
    v = abs(w.middle)
    g = p.geometry
    known = w.used < GRIP
    # yaw by articulation, without lateral slip; what tyres give way grows with the lateral acceleration
    expected = (w.middle * math.sin(m[ANGLE]) - g.front_length * m[RATE]) / (
        g.front_length + g.rear_length * math.cos(m[ANGLE])
    )
    sideways = abs(m[FORCE + 1])
    r[YAW_STEERING] = expected - m[YAW_RATE]
    bound[YAW_STEERING] += abs(expected) * (t.radius + w.slip) + 0.2 * abs(m[RATE])
    bound[YAW_STEERING] += (
        (0.5 + t.stiffness)
        * v
        * sideways
        / (p.wheel.cornering_stiffness * GRAVITY)
        / (g.front_length + g.rear_length)
    )
    accelerations(m, w, t, p, state, dt, started, r, bound)
    torques(m, w, t, p, state, dt, started, r, bound)
    if not known or v < ROLLING:
        bound[YAW_STEERING] = bound[ALONG] = NOTHING
    bucket(m, p, t, state, dt, r, bound, rules)
    r[STEERING_LINES] = min(m[LEFT_LINE], m[RIGHT_LINE]) - t.back_pressure


@compiled
def angles(m: Floats, state: Floats, dt: float, started: bool, r: Floats) -> None:
    """Angles against their rates, by observers that forget."""
    share = dt / OBSERVED
    roll_turning = m[PITCH_RATE] * math.sin(m[ROLL]) + m[YAW_RATE] * math.cos(m[ROLL])
    roll_change = m[ROLL_RATE] + roll_turning * math.tan(m[PITCH])
    pitch_change = m[PITCH_RATE] * math.cos(m[ROLL]) - m[YAW_RATE] * math.sin(m[ROLL])
    if not started:
        state[FILTERS, F_ANGLE], state[FILTERS, F_ROLL], state[FILTERS, F_PITCH] = m[ANGLE], m[ROLL], m[PITCH]
    state[FILTERS, F_ANGLE] += m[RATE] * dt + share * (m[ANGLE] - state[FILTERS, F_ANGLE])
    state[FILTERS, F_ROLL] += roll_change * dt + share * (m[ROLL] - state[FILTERS, F_ROLL])
    state[FILTERS, F_PITCH] += pitch_change * dt + share * (m[PITCH] - state[FILTERS, F_PITCH])
    r[ANGLE_RATE] = m[ANGLE] - state[FILTERS, F_ANGLE]
    r[ROLL_GYRO] = m[ROLL] - state[FILTERS, F_ROLL]
    r[PITCH_GYRO] = m[PITCH] - state[FILTERS, F_PITCH]
    r[PITCH_RATES] = m[SLOPE_RATE] - m[PITCH_RATE]


@compiled
def speed_pairs(m: Floats, w: Wheels, t: Tolerances, r: Floats, bound: Floats) -> None:
    """The rear axle's speed as every two wheels have it."""
    v = abs(w.middle)
    least = v * (2.0 * t.radius + w.slip * (2.0 * t.stiffness + w.used))
    least += SCRUB * (abs(m[YAW_RATE]) + abs(m[RATE]))
    drift = abs(m[YAW_RATE] * math.sin(m[ANGLE])) * 0.15
    r[SPEEDS], r[SPEEDS + 1], r[SPEEDS + 2] = w.v1 - w.v2, w.v1 - w.v3, w.v1 - w.v4
    r[SPEEDS + 3], r[SPEEDS + 4], r[SPEEDS + 5] = w.v2 - w.v3, w.v2 - w.v4, w.v3 - w.v4
    for k in range(SPEEDS, SPEEDS + 6):
        bound[k] += least
        if SPEEDS < k < SPEEDS + 5:
            bound[k] += drift
        # a wheel that its brake holds while the machine steers at a standstill is dragged sideways
        if w.used > GRIP or v < ROLLING:
            bound[k] = NOTHING


@compiled
def accelerations(
    m: Floats,
    w: Wheels,
    t: Tolerances,
    p: Parameters,
    state: Floats,
    dt: float,
    started: bool,
    r: Floats,
    bound: Floats,
) -> None:
    """The three specific forces against wheels, slope and yaw rate."""
    share, quick = dt / (SLOW + dt), dt / (QUICK + dt)
    yaw, s = m[YAW_RATE], p.sensors
    before = state[FILTERS, F_SPEED]
    if not started:
        state[FILTERS, F_SPEED] = before = w.middle
    speed = follow(state, F_SPEED, w.middle, quick)
    change = follow(state, F_ACCELERATION, (speed - before) / dt, share)
    behind = p.geometry.rear_length + s.imu_x
    along = m[FORCE] + GRAVITY * math.sin(m[PITCH]) + yaw * yaw * behind
    across = m[FORCE + 1] - GRAVITY * math.sin(m[ROLL]) * math.cos(m[PITCH]) - yaw * w.middle
    r[ALONG] = follow(state, F_ALONG, along, share) - change
    r[ACROSS] = follow(state, F_ACROSS, across, share)
    upwards = m[FORCE + 2] - GRAVITY * math.cos(m[ROLL]) * math.cos(m[PITCH])
    r[UPWARDS] = follow(state, F_UP, upwards, share)  # without the bounce on the tyres
    bound[ALONG] += abs(change) * (t.radius + w.slip) + abs(yaw) * 0.3
    # while the machine steers, sensor and axle do not feel the same: the yaw rate changes
    bound[ACROSS] += abs(yaw * w.middle) * (t.radius + w.slip + t.stiffness) + abs(yaw) * 0.5 + abs(m[RATE])


@compiled
def torques(
    m: Floats,
    w: Wheels,
    t: Tolerances,
    p: Parameters,
    state: Floats,
    dt: float,
    started: bool,
    r: Floats,
    bound: Floats,
) -> None:
    """Torques left against right, and all of them against acceleration and mass."""
    radius = effective_radius(p)
    total = 0.0
    for k in range(4):
        total += m[TORQUE + k]
    for k in range(2):
        left, right = m[TORQUE + 2 * k], m[TORQUE + 2 * k + 1]
        size = max(abs(left), abs(right))
        fast = max(abs(m[WHEEL + 2 * k]), abs(m[WHEEL + 2 * k + 1]))
        r[FRONT_TORQUES + k] = left - right
        bound[FRONT_TORQUES + k] += 2.0 * t.torque * size
        # at the power's limit torque goes with one over speed; a wheel that stands gives its brake's reaction
        if size * fast > t.power or abs(w.middle) < ROLLING:
            bound[FRONT_TORQUES + k] = NOTHING
    mass = machine_mass(p) + max(payload_of(m, p), 0.0)
    weight = mass * GRAVITY
    traction = total / radius
    r[TRACTION] = traction - mass * m[FORCE]
    bound[TRACTION] += (t.rolling + t.mass * abs(m[FORCE]) / GRAVITY) * weight + t.torque * abs(traction)
    bound[TRACTION] += t.digging
    if abs(w.middle) < ROLLING:
        bound[TRACTION] = NOTHING


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
    m: Floats, p: Parameters, t: Tolerances, state: Floats, dt: float, r: Floats, bound: Floats, rules: Floats
) -> None:
    """Where the payload lies by both pressures, against where it has to lie [N m about the bucket's pin]."""
    b = balance_of(m, p)
    payload = (b.arm + b.arm_lift * m[LIFT] + b.arm_tilt * m[TILT]) / b.arm_load
    r[BUCKET_LOAD] = b.pin + b.pin_tilt * m[TILT] - payload * b.pin_load
    bound[BUCKET_LOAD] += (max(payload, 0.0) * (t.centre + t.mass) + p.bucket.mass * t.centre) * GRAVITY
    bound[BUCKET_LOAD] += abs(payload) * 0.1 * GRAVITY
    if m[TILT] < EMPTY or abs(state[TREND, ARM]) > STIRRING:
        bound[BUCKET_LOAD] = NOTHING
    elif abs(r[BUCKET_LOAD]) < bound[BUCKET_LOAD]:
        follow(state, F_COUPLE, r[BUCKET_LOAD], dt / (REMEMBERED + dt))


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
