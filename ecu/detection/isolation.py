"""Which signal is wrong: sequential tests of the residuals, and the faults that explain all of them.

A residual's test is a CUSUM in standard deviations beyond its bound, upwards and downwards. When one has fired, each
signal is tried as the one that is wrong: the size that explains the fired residuals best has to leave no residual
beyond its bound. Every signal that passes is a candidate; where several pass, the changes of the torques may exclude some
(`ecu.detection.changes`). Where several are left, the readings do not show which one is wrong.
"""

import numpy as np
from numpy.typing import NDArray

from ecu.detection.changes import UNKNOWN, unexplained
from ecu.detection.compiled import compiled
from ecu.detection.layout import (
    ACROSS,
    ALONG,
    ANGLE_RATE,
    BUCKET_LOAD,
    BY_RESIDUAL,
    DOWN,
    F_ANGLE,
    F_PITCH,
    F_PITCH_SWING,
    F_PITCH_TAKEN,
    F_PITCHED,
    F_ROLL,
    F_ROLL_SWING,
    F_ROLL_TAKEN,
    F_ROLLED,
    F_TURNED,
    F_WARM,
    FAULTY,
    FILTERS,
    FIRED,
    FRONT_TORQUES,
    JUMPED,
    MEAN,
    MODE,
    NOISE,
    PITCH_GYRO,
    PITCH_RATES,
    RESIDUALS,
    ROLL_GYRO,
    SINCE,
    SIZE,
    SPEEDS,
    SPOILED,
    STEERING_LINES,
    TRACTION,
    UNDECIDED,
    UP,
    UPWARDS,
    WAITING,
    YAW_STEERING,
)  # fmt: skip
from ecu.detection.machine import NOTHING, OBSERVED, effective_radius, machine_mass, over, remaining
from ecu.estimators.parameters import GRAVITY, Parameters
from ecu.watched import (
    ANGLE,
    ARM,
    BUCKET,
    COUNT,
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
DRIFT = 0.5
"""What a test forgives per sample [standard deviations]."""
WINDOW = 0.15
"""How long after the first test others are waited for before the faulty signal is named [s]."""
RECOVERY = 1.5
"""How long a residual's filters take to forget a fault [s]."""
AVERAGE = 0.1
"""Time constant of the mean of a residual [s]."""
SLACK = 0.7
"""A candidate may leave so much of a bound: bounds add up what is worst, sound residuals stay below two thirds of theirs."""
SETTLED = 0.5
"""Share of what is permitted up to which a change is explained: half, where SLACK starts to exclude."""
CLEARED = 2.0 * NOTHING
"""In place of the misfit of a candidate that cannot be the one."""
QUIET = 2.0
"""A fault found by residuals is over after so long without one [s]."""


@compiled
def sensitivities(m: Floats, speed: float, p: Parameters, out: Floats) -> None:
    """How residuals change with an offset of each signal, (RESIDUALS, COUNT): SI over SI."""
    out[:] = 0.0
    g, radius = p.geometry, effective_radius(p)
    base = g.front_length + g.rear_length
    out[ANGLE_RATE, ANGLE], out[ANGLE_RATE, RATE] = 1.0, -1.0
    out[ROLL_GYRO, ROLL], out[ROLL_GYRO, ROLL_RATE] = 1.0, -1.0
    out[PITCH_GYRO, PITCH], out[PITCH_GYRO, PITCH_RATE] = 1.0, -1.0
    # an accelerometer's offset leans the slope until its mean is taken for an offset: half of it at most
    leaning = 0.5 * OBSERVED / (OBSERVED + p.sensors.slope_levelling) / GRAVITY
    out[PITCH_GYRO, FORCE], out[PITCH_GYRO, FORCE + 2] = leaning, -leaning * m[FORCE] / GRAVITY
    out[ROLL_GYRO, FORCE + 1], out[ROLL_GYRO, FORCE + 2] = -leaning, leaning * m[FORCE + 1] / GRAVITY
    out[PITCH_RATES, SLOPE_RATE], out[PITCH_RATES, PITCH_RATE] = 1.0, -1.0
    half = (g.front_track + g.rear_track) / 4.0
    place = SPEEDS
    for a in range(4):
        for b in range(a + 1, 4):
            out[place, WHEEL + a], out[place, WHEEL + b] = radius, -radius
            side = (1.0 if a % 2 == 0 else -1.0) - (1.0 if b % 2 == 0 else -1.0)
            out[place, YAW_RATE] = half * side
            turned = (1.0 if a % 2 == 0 else -1.0) * (1.0 if a < 2 else 0.0)
            turned -= (1.0 if b % 2 == 0 else -1.0) * (1.0 if b < 2 else 0.0)
            out[place, RATE] = half * turned
            place += 1
    out[YAW_STEERING, ANGLE], out[YAW_STEERING, RATE] = speed / base, -g.front_length / base
    out[YAW_STEERING, YAW_RATE] = -1.0
    out[ALONG, FORCE], out[ALONG, PITCH] = 1.0, GRAVITY
    out[ACROSS, FORCE + 1], out[ACROSS, ROLL], out[ACROSS, YAW_RATE] = 1.0, -GRAVITY, -speed
    out[UPWARDS, FORCE + 2] = 1.0
    for k in range(2):
        out[FRONT_TORQUES + k, TORQUE + 2 * k], out[FRONT_TORQUES + k, TORQUE + 2 * k + 1] = 1.0, -1.0
    mass = machine_mass(p)
    for k in range(4):
        out[TRACTION, TORQUE + k] = 1.0 / radius
    out[TRACTION, FORCE] = -mass
    out[BUCKET_LOAD, TILT] = p.tilt_linkage.head_area * 0.3
    out[BUCKET_LOAD, LIFT] = -p.cylinders.head_area * 0.08
    out[BUCKET_LOAD, ARM] = out[BUCKET_LOAD, BUCKET] = 0.2 * p.bucket.mass * GRAVITY
    # the lower pressure is that of the line that does not push
    out[STEERING_LINES, LEFT_LINE if m[LEFT_LINE] < m[RIGHT_LINE] else RIGHT_LINE] = 1.0


@compiled
def test(
    m: Floats,
    usable: Floats,
    sensitive: Floats,
    rules: Floats,
    height: float,
    state: Floats,
    dt: float,
    r: Floats,
    bound: Floats,
) -> int:
    """One step of every sequential test; returns how many have fired and are not explained by a known fault."""
    fired = 0
    for j in range(RESIDUALS):
        spoiled = not over(state[FILTERS, F_WARM], RECOVERY)
        for k in range(COUNT):
            if sensitive[j, k] != 0.0 and (state[FAULTY, k] != 0.0 or usable[k] == 0.0):
                spoiled = True
        if spoiled:
            state[SPOILED, j] = RECOVERY
        elif state[SPOILED, j] > 0.0:
            state[SPOILED, j] = remaining(state[SPOILED, j], dt)
            spoiled = True
        if spoiled:
            state[UP, j] = state[DOWN, j] = state[FIRED, j] = state[MEAN, j] = 0.0
            continue
        state[MEAN, j] += dt / AVERAGE * (r[j] - state[MEAN, j])
        noise = rules[NOISE, j]
        state[UP, j] = min(max(state[UP, j] + (r[j] - bound[j]) / noise - DRIFT, 0.0), 2.0 * height)
        state[DOWN, j] = min(max(state[DOWN, j] - (r[j] + bound[j]) / noise - DRIFT, 0.0), 2.0 * height)
        state[FIRED, j] = 1.0 if max(state[UP, j], state[DOWN, j]) > height else 0.0
        fired += 1 if state[FIRED, j] != 0.0 else 0
    resynchronised(m, state)
    return fired


@compiled
def resynchronised(m: Floats, state: Floats) -> None:
    """Observers of residuals that a fault has spoiled begin anew."""
    # with what the rates have added since: gain errors count from the new beginning on
    if state[SPOILED, ANGLE_RATE] > 0.0:
        state[FILTERS, F_ANGLE], state[FILTERS, F_TURNED] = m[ANGLE], 0.0
    if state[SPOILED, ROLL_GYRO] > 0.0:
        state[FILTERS, F_ROLL] = m[ROLL] - state[FILTERS, F_ROLL_TAKEN] - state[FILTERS, F_ROLL_SWING]
        state[FILTERS, F_ROLLED] = 0.0
    if state[SPOILED, PITCH_GYRO] > 0.0:
        state[FILTERS, F_PITCH] = m[PITCH] - state[FILTERS, F_PITCH_TAKEN] - state[FILTERS, F_PITCH_SWING]
        state[FILTERS, F_PITCHED] = 0.0


@compiled
def misfit(k: int, sensitive: Floats, rules: Floats, state: Floats, bound: Floats) -> float:
    """The largest share of a bound that an offset of signal `k` leaves, when it explains the residuals best."""
    top = base = 0.0
    for j in range(RESIDUALS):
        if state[SPOILED, j] <= 0.0 and bound[j] < NOTHING:
            scale = sensitive[j, k] / (bound[j] + rules[NOISE, j])
            top += scale * state[MEAN, j] / (bound[j] + rules[NOISE, j])
            base += scale * scale
    if base == 0.0:
        return NOTHING
    size, worst = top / base, 0.0
    state[SIZE, k] = size
    for j in range(RESIDUALS):
        if state[SPOILED, j] <= 0.0 and bound[j] < NOTHING:
            left = abs(state[MEAN, j] - sensitive[j, k] * size) / (bound[j] + rules[NOISE, j])
            worst = max(worst, left)
    return worst


@compiled
def narrowed(allowed: float, left: Floats, state: Floats) -> None:
    """Take those out of the candidates without which a change stays unexplained, when another one explains it."""
    explained = False
    for k in range(COUNT):
        if left[k] <= allowed:
            share = unexplained(k, state)
            explained |= share != UNKNOWN and share <= SETTLED
    for k in range(COUNT):
        if explained and left[k] <= allowed and unexplained(k, state) > SLACK:
            left[k] = CLEARED


@compiled
def isolate(fired: int, sensitive: Floats, rules: Floats, state: Floats, bound: Floats, dt: float) -> int:
    """Name the signals that can be wrong once the window is over; returns how many."""
    if fired == 0:
        state[WAITING, 0] = 0.0
        return 0
    state[WAITING, 0] += dt
    if not over(state[WAITING, 0], WINDOW):
        return 0
    state[WAITING, 0] = 0.0
    left = np.empty(COUNT)
    least = NOTHING
    for k in range(COUNT):
        touched = False
        for j in range(RESIDUALS):
            if state[FIRED, j] != 0.0 and sensitive[j, k] != 0.0:
                touched = True
        left[k] = misfit(k, sensitive, rules, state, bound) if touched else NOTHING
        least = min(least, left[k])
    allowed = max(SLACK, least * 1.1)
    narrowed(allowed, left, state)
    found = 0
    for k in range(COUNT):
        found += 1 if left[k] <= allowed else 0
    for k in range(COUNT):
        if left[k] <= allowed:
            state[FAULTY, k], state[SINCE, k], state[JUMPED, k] = 1.0, 0.0, 0.0
            state[MODE, k] = BY_RESIDUAL if found == 1 else UNDECIDED
    return found
