"""Residuals: what two or more signals say of the same thing, subtracted; zero without a fault, up to noise and tolerance.

Each has a bound that is computed in every cycle. It holds the uncertainty of masses, radii, stiffness and centres of gravity
at the present speed, torque and turn, and the terms that the residual's own equation leaves out: gain errors, samples
of different times, sideslip, load transfer, slip near the limit, acceleration of what the equation takes as rigid. A residual whose
premises do not hold at present says nothing: its bound is NOTHING, and stays so until its filters have forgotten.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ecu.detection.bucket import bucket, payload_of
from ecu.detection.compiled import compiled
from ecu.detection.inclination import Lean, corrected, swinging
from ecu.detection.layout import (
    ACROSS,
    ALONG,
    ANGLE_RATE,
    BUCKET_LOAD,
    F_ACCELERATION,
    F_ACROSS,
    F_ALONG,
    F_ANGLE,
    F_CYCLES,
    F_DRAG,
    F_PITCH,
    F_PITCHED,
    F_ROLL,
    F_ROLLED,
    F_SLOW_ROLL,
    F_SLOW_YAW,
    F_SPEED,
    F_TURNED,
    F_UP,
    F_YAWED,
    FAULTY,
    FILTERS,
    FRONT_TORQUES,
    PAUSED,
    PITCH_GYRO,
    PITCH_RATES,
    RESIDUALS,
    ROLL_GYRO,
    SPEEDS,
    STEERING_LINES,
    STIR,
    TOLERANCE,
    TRACTION,
    UPWARDS,
)  # fmt: skip
from ecu.detection.machine import (
    NOTHING,
    OBSERVED,
    STANDING,
    effective_radius,
    follow,
    machine_mass,
    remaining,
)
from ecu.detection.motion import Motion, motion
from ecu.detection.wheels import Wheels, speed_pairs, wheel_speeds, yaw_by_steering
from ecu.detection_rules import Tolerances
from ecu.estimators.inclination import Slope
from ecu.estimators.parameters import GRAVITY, Parameters
from ecu.watched import (
    ANGLE,
    FORCE,
    LEFT_LINE,
    PITCH,
    PITCH_RATE,
    RATE,
    RIGHT_LINE,
    ROLL,
    ROLL_RATE,
    SLOPE_RATE,
    TORQUE,
    WHEEL,
    YAW_RATE,
)  # fmt: skip

Floats = NDArray[np.float64]

QUICK, SLOW = 0.05, 0.3
"""Time constants of the speed's derivative and of the accelerations [s]."""
ROLLING = 0.5
"""Speed below which wheels may be held by their brakes [m/s]."""
STRUCK = 0.5
"""Onsets in two messages or more from which on the machine was struck: its tyres and its frame swing."""
FORGOTTEN = 1.0
"""Time after which a residual means something again when its premises hold again [s]: three of SLOW."""
CHANGING_LAG = 0.05
"""Time by which filtered accelerations of different sensors differ at most [s]."""


@compiled
def residuals(
    m: Floats,
    usable: Floats,
    p: Parameters,
    t: Tolerances,
    rules: Floats,
    state: Floats,
    dt: float,
    r: Floats,
    bound: Floats,
) -> None:
    """All residuals into `r` and their bounds into `bound`, both (RESIDUALS,). usable: 0 where other checks reject a signal."""
    started = state[FILTERS, F_CYCLES] > 0.0
    state[FILTERS, F_CYCLES] += 1.0
    for j in range(RESIDUALS):
        bound[j] = rules[TOLERANCE, j]
    w = wheel_speeds(m, p)
    q = motion(m, w.middle, w.used, payload_of(m, p), p, t, state, dt, started)
    freed = m.copy()  # of what accelerations add to the slope sensor's reading
    lean, rolled = corrected(freed, w, q, p, t, state, dt, started)
    felt = True
    for k in range(FORCE, FORCE + 3):
        felt &= usable[k] != 0.0 and state[FAULTY, k] == 0.0
    swing, unsure = swinging(freed, q, rolled, p, t, rules, felt, state, dt)
    angles(
        freed,
        swing,
        q,
        Lean(lean.pitch + unsure.pitch, lean.roll + unsure.roll),
        t,
        state,
        dt,
        started,
        r,
        bound,
    )
    speed_pairs(freed, w, q, p, t, r, bound)
    yaw_by_steering(freed, w, q, p, t, r, bound)
    accelerations(freed, w, q, lean, t, p, state, dt, started, r, bound)
    torques(freed, w, q, t, p, state, dt, r, bound)
    digging = state[FILTERS, F_DRAG] > t.digging / 2.0
    bucket(freed, q, digging, p, t, state, dt, r, bound)
    r[STEERING_LINES] = min(freed[LEFT_LINE], freed[RIGHT_LINE]) - t.back_pressure
    bound[STEERING_LINES] += 0.2 * q.lines
    premises(w, q, state, dt, bound)


@compiled
def premises(w: Wheels, q: Motion, state: Floats, dt: float, bound: Floats) -> None:
    """Residuals whose equations do not hold say nothing, and some time afterwards."""
    rolling = q.known and abs(w.middle) > ROLLING
    struck = second(state[STIR]) > STRUCK
    for j in range(RESIDUALS):
        by_wheels = SPEEDS <= j <= ALONG or j == FRONT_TORQUES or j == FRONT_TORQUES + 1
        by_masses = j in (ALONG, ACROSS, UPWARDS, TRACTION, BUCKET_LOAD)
        silent = bound[j] >= NOTHING
        silent |= by_wheels and not rolling
        silent |= j == ACROSS and not q.known
        silent |= (by_wheels or by_masses) and struck
        if silent:
            state[PAUSED, j] = FORGOTTEN
        elif state[PAUSED, j] > 0.0:
            state[PAUSED, j] = remaining(state[PAUSED, j], dt)
        if state[PAUSED, j] > 0.0:
            bound[j] = NOTHING


@compiled
def second(values: Floats) -> float:
    """The second largest: one faulty message alone does not count."""
    first = other = 0.0
    for i in range(values.size):
        value = values[i]
        if value > first:
            first, other = value, first
        elif value > other:
            other = value
    return other


@compiled
def observed(state: Floats, place: int, angle: float, rate: float, dt: float) -> float:
    """What an angle has beyond its observer [rad], which adds up its rate and forgets with OBSERVED."""
    # the rate first: the other way round the observer is late by one cycle, as if the rate were 1 % wrong
    state[FILTERS, place] += rate * dt
    return angle - follow(state, place, angle, dt / OBSERVED)


@compiled
def leaked(state: Floats, place: int, rate: float, dt: float) -> float:
    """What a rate adds to an observer's angle [rad]: its integral, which leaks as the observer forgets."""
    state[FILTERS, place] = (state[FILTERS, place] + rate * dt) * (1.0 - dt / OBSERVED)
    return state[FILTERS, place]


@compiled
def angles(
    m: Floats,
    swing: Slope,
    q: Motion,
    lean: Lean,
    t: Tolerances,
    state: Floats,
    dt: float,
    started: bool,
    r: Floats,
    bound: Floats,
) -> None:
    """Angles against their rates, by observers that forget.

    A gain error of the rate leaves its share of the leaked integral L; samples of another time leave
    time (rate - L / OBSERVED), and time squared of its change where this passes zero.
    """
    pitch, roll = m[PITCH] - swing.pitch, m[ROLL] - swing.roll
    roll_turning = m[PITCH_RATE] * math.sin(roll) + m[YAW_RATE] * math.cos(roll)
    roll_change = m[ROLL_RATE] + roll_turning * math.tan(pitch)
    pitch_change = m[PITCH_RATE] * math.cos(roll) - m[YAW_RATE] * math.sin(roll)
    if not started:
        state[FILTERS, F_ANGLE], state[FILTERS, F_ROLL], state[FILTERS, F_PITCH] = m[ANGLE], roll, pitch
    r[ANGLE_RATE] = observed(state, F_ANGLE, m[ANGLE], m[RATE], dt)
    r[ROLL_GYRO] = observed(state, F_ROLL, roll, roll_change, dt)
    r[PITCH_GYRO] = observed(state, F_PITCH, pitch, pitch_change, dt)
    r[PITCH_RATES] = m[SLOPE_RATE] - m[PITCH_RATE]
    turned = leaked(state, F_TURNED, m[RATE], dt)
    rolled, pitched = leaked(state, F_ROLLED, roll_change, dt), leaked(state, F_PITCHED, pitch_change, dt)
    # a gyro's axis that is not quite upright takes a share of the yaw
    yawed = leaked(state, F_YAWED, abs(m[YAW_RATE]), dt)
    bound[ANGLE_RATE] += t.gain * abs(turned) + t.time * abs(m[RATE] - turned / OBSERVED)
    bound[ANGLE_RATE] += t.time * t.time * (q.joint + abs(m[RATE]) / OBSERVED)
    bound[ROLL_GYRO] += t.gain * (abs(rolled) + yawed) + t.time * abs(roll_change - rolled / OBSERVED)
    bound[ROLL_GYRO] += t.time * t.time * (q.roll + abs(roll_change) / OBSERVED)
    bound[PITCH_GYRO] += t.gain * (abs(pitched) + yawed) + t.time * abs(pitch_change - pitched / OBSERVED)
    bound[PITCH_GYRO] += t.time * t.time * (q.pitch + abs(pitch_change) / OBSERVED)
    bound[ROLL_GYRO] += lean.roll
    bound[PITCH_GYRO] += lean.pitch
    bound[PITCH_RATES] += t.gain * (abs(m[PITCH_RATE]) + abs(m[YAW_RATE])) + t.time * q.pitch


@compiled
def accelerations(
    m: Floats,
    w: Wheels,
    q: Motion,
    lean: Lean,
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
    yaw, s, v = m[YAW_RATE], p.sensors, abs(w.middle)
    before = state[FILTERS, F_SPEED]
    if not started:
        state[FILTERS, F_SPEED] = before = w.middle
    speed = follow(state, F_SPEED, w.middle, quick)
    change = follow(state, F_ACCELERATION, (speed - before) / dt, share)
    behind = p.geometry.rear_length + s.imu_x
    # a filtered derivative is the distance from the filtered signal over its time
    yawing = (yaw - follow(state, F_SLOW_YAW, yaw, share)) / SLOW
    rolling = (m[ROLL_RATE] - follow(state, F_SLOW_ROLL, m[ROLL_RATE], share)) / SLOW
    along = m[FORCE] + GRAVITY * math.sin(m[PITCH]) + yaw * yaw * behind
    across = m[FORCE + 1] - GRAVITY * math.sin(m[ROLL]) * math.cos(m[PITCH]) - yaw * w.middle
    upwards = m[FORCE + 2] - GRAVITY * math.cos(m[ROLL]) * math.cos(m[PITCH])
    r[ALONG] = follow(state, F_ALONG, along, share) - change
    r[ACROSS] = follow(state, F_ACROSS, across, share) - behind * yawing + s.imu_z * rolling
    r[UPWARDS] = follow(state, F_UP, upwards, share)  # without the bounce on the tyres
    give = v * q.rear_slip
    grip = q.grip / (p.wheel.slip_stiffness * (1.0 - t.stiffness))
    bound[ALONG] += abs(change) * (t.radius + w.used / p.wheel.slip_stiffness + t.gain) + abs(yaw) * give
    # slip, pitching and samples of another time while traction changes; the speed passes one filter more
    bound[ALONG] += (
        v * grip + t.time * q.pitch * s.imu_z + (QUICK + t.time) * q.speed + CHANGING_LAG * q.ahead
    ) / SLOW
    bound[ALONG] += abs(yaw) * behind * abs(yaw) * t.gain
    bound[ALONG] += GRAVITY * lean.pitch
    bound[ACROSS] += GRAVITY * lean.roll
    bound[ACROSS] += abs(yaw) * v * (t.radius + w.used / p.wheel.slip_stiffness + t.gain)
    # sideslip that grows or vanishes within the filter's time
    bound[ACROSS] += give / SLOW * min(1.0, q.aside / (q.side * GRAVITY + 0.1) + (q.yaw + q.joint) * SLOW)
    bound[ACROSS] += 0.3 * (abs(yawing) * behind + abs(rolling) * s.imu_z) + CHANGING_LAG / SLOW * q.aside
    bound[UPWARDS] += abs(m[PITCH_RATE]) * v + 0.5 * q.upright + CHANGING_LAG / SLOW * q.pitch * behind


@compiled
def torques(
    m: Floats,
    w: Wheels,
    q: Motion,
    t: Tolerances,
    p: Parameters,
    state: Floats,
    dt: float,
    r: Floats,
    bound: Floats,
) -> None:
    """Torques left against right, and all of them against acceleration and mass."""
    radius = effective_radius(p)
    total = 0.0
    for k in range(4):
        total += m[TORQUE + k]
    mass = machine_mass(p) + max(payload_of(m, p), 0.0)
    weight = mass * GRAVITY
    for k in range(2):
        left, right = m[TORQUE + 2 * k], m[TORQUE + 2 * k + 1]
        size = max(abs(left), abs(right))
        fast = max(abs(m[WHEEL + 2 * k]), abs(m[WHEEL + 2 * k + 1]))
        r[FRONT_TORQUES + k] = left - right
        # the two motors follow what they are asked for at slightly different times
        bound[FRONT_TORQUES + k] += 2.0 * t.torque * size + 0.5 * q.grip * weight / 4.0 * radius
        # a brake that holds its wheel bears what its pressure does not show
        if min(abs(m[WHEEL + 2 * k]), abs(m[WHEEL + 2 * k + 1])) < STANDING:
            bound[FRONT_TORQUES + k] = NOTHING
        # at the power's limit torque goes with one over speed
        if size * fast > t.power:
            bound[FRONT_TORQUES + k] = NOTHING
    traction = total / radius
    r[TRACTION] = traction - mass * m[FORCE]
    # what holds the machine back acts against its motion: a pile, which only a machine that goes ahead meets
    follow(state, F_DRAG, r[TRACTION], dt / (SLOW + dt))
    bound[TRACTION] += (t.rolling + t.mass * abs(m[FORCE]) / GRAVITY) * weight + t.torque * abs(traction)
    bound[TRACTION] += t.digging + q.grip * weight + mass * q.ahead
    # of a bent machine some of the side force of one unit acts along the other; tyres that slip sideways drag
    bound[TRACTION] += weight * q.side * (0.5 * abs(math.sin(m[ANGLE])) + 2.0 * q.sideslip)
    bound[TRACTION] += 4.0 * p.wheel.spin_inertia / (radius * radius) * q.speed
    if abs(w.middle) < ROLLING or w.used >= 1.0 or (r[TRACTION] > 0.0 and w.middle > 0.0):
        bound[TRACTION] = NOTHING
