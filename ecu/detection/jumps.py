"""Test of every single sample against its prediction: jumps, spikes, exchanged signals, and what stands still.

A sample may lie from its prediction as far as noise goes, and further by what the signals of other messages show of a shock
or of the driver's doing. Because some feel it later, a jump waits for them before it is a fault. The jumps of a
signal add up to the offset that it carries: a spike takes its jump back, an offset does not.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ecu.detection.compiled import compiled
from ecu.detection.layout import (
    BY_FREEZE,
    BY_JUMP,
    CYCLES,
    EVER,
    F_PITCH_LEAN,
    F_PITCH_TAKEN,
    F_ROLL_LEAN,
    F_ROLL_TAKEN,
    FAULTY,
    FILTERS,
    FREEZE,
    GAP,
    JUMP,
    JUMPED,
    LARGEST,
    LAST,
    LEVEL,
    MODE,
    ONSET,
    RAMP,
    REJECTED,
    SAME,
    SAMPLE,
    SINCE,
    SOUND,
    STIR,
    STIRRED,
    SUSPECTED,
    THRESHOLD,
    TREND,
)  # fmt: skip
from ecu.detection.machine import NOTHING, STANDING, over
from ecu.watched import (
    ANGLE,
    COUNT,
    LIFT,
    PITCH,
    PITCH_RATE,
    RATE,
    ROLL,
    ROLL_RATE,
    SLOPE_RATE,
    TILT,
    TORQUE,
    WHEEL,
    YAW_RATE,
)  # fmt: skip

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

FOLLOW = 0.2
"""Share of a sample's innovation that the trend takes over."""
MEMORY = 0.05
"""Share of a sample that the level of a signal's liveliness takes over: 0.2 s."""
LIVELY = 9.0
"""Innovations this many times their usual magnitude are jumps: 7 standard deviations of Gaussian noise."""
SWINGS = 0.1
"""Time constant with which a shock fades [s]: tyres and frame swing on."""
REACH = 16.0
"""How many times more onsets than the others a signal may show: a wheel on a kerb turns before the frame has moved."""
EXPLAINED = 0.05
"""How long a jump waits for others that explain it [s]: gyros and pressures follow a wheel's jump within it."""
POSE = 2.0
"""How many times more a pressure may show of a moment than the frame does: by the linkage 0.6 to 1.6 times of the middle over the arm's way."""
HELD_STILL = 3.0
"""A jump after so many equal samples is the end of a standstill, not an offset."""


@compiled
def increment(k: int, m: Floats, state: Floats, dt: float) -> float:
    """How far signal `k` is expected to move since the last cycle."""
    if k == ANGLE:
        return m[RATE] * dt
    f = state[FILTERS]
    # the slope itself by the gyro, and what accelerations add to its sensor's reading by the last correction
    pitch, roll = m[PITCH] - f[F_PITCH_TAKEN], m[ROLL] - f[F_ROLL_TAKEN]
    if k == PITCH:
        change = m[PITCH_RATE] * math.cos(roll) - m[YAW_RATE] * math.sin(roll)
        return change * dt + f[F_PITCH_LEAN] - f[F_PITCH_TAKEN]
    if k == ROLL:
        turning = m[PITCH_RATE] * math.sin(roll) + m[YAW_RATE] * math.cos(roll)
        return (m[ROLL_RATE] + turning * math.tan(pitch)) * dt + f[F_ROLL_LEAN] - f[F_ROLL_TAKEN]
    if WHEEL <= k < WHEEL + 4:
        return together(k, WHEEL, m, state)
    return state[TREND, k]


@compiled
def together(k: int, first: int, m: Floats, state: Floats) -> float:
    """Median of the moves of the three other wheels: what moves all of them is no fault of one."""
    a = b = c = 0.0
    for i in range(first, first + 4):
        if i != k:
            a, b, c = b, c, m[i] - state[LAST, i]
    return max(min(a, b), min(max(a, b), c))


@compiled
def look(m: Floats, heard: Integers, message: Integers, rules: Floats, state: Floats, dt: float) -> int:
    """Test the samples of one cycle; returns how many signals turned faulty. heard: what came of each."""
    innovation = np.zeros(COUNT)
    for k in range(COUNT):
        state[GAP, k] += 1.0
        if (
            heard[k] == REJECTED
        ):  # the signal goes on where it is expected until another check believes it again
            state[LAST, k] += increment(k, m, state, dt) if k == ANGLE else 0.0
            state[GAP, k] = 0.0
        if heard[k] != SAMPLE:
            continue
        state[SAME, k] = state[SAME, k] + 1.0 if m[k] == state[LAST, k] else 0.0
        innovation[k] = m[k] - state[LAST, k] - increment(k, m, state, dt)
        if state[GAP, k] > rules[CYCLES, k]:  # after a gap there is no prediction
            innovation[k] = 0.0
    stir(innovation, message, rules, state, dt)
    ramp(PITCH_RATE, innovation[PITCH_RATE], state, dt)
    ramp(SLOPE_RATE, innovation[SLOPE_RATE], state, dt)
    for k in range(COUNT):
        state[THRESHOLD, k] = threshold(k, message[k], rules, state)
    for wheel in range(4):
        # a brake that grips or lets go of a wheel takes its torque out of the signal or into it (ADR 44), and nothing else moves
        if min(abs(m[WHEEL + wheel]), abs(state[LAST, WHEEL + wheel])) < STANDING:
            state[THRESHOLD, TORQUE + wheel] = NOTHING
    found = 0
    for k in range(COUNT):
        if heard[k] == SAMPLE:
            found += sample(k, m, innovation[k], rules, state)
        if state[SUSPECTED, k] > 0.0:
            found += suspected(k, message, rules, state, dt)
    return found + standstill(heard, rules, state)


@compiled
def stir(innovation: Floats, message: Integers, rules: Floats, state: Floats, dt: float) -> None:
    """How much each message's signals were stirred lately, in onsets: what fades with SWINGS, and what came now.

    A signal that is known to be faulty stirs nothing.
    """
    fade = math.exp(-dt / SWINGS)
    for i in range(state.shape[1]):
        state[STIR, i] *= fade
    for k in range(COUNT):
        beyond = abs(innovation[k]) - rules[STIRRED, k]
        if beyond > 0.0 and state[FAULTY, k] == 0.0:
            state[STIR, message[k]] = max(state[STIR, message[k]], beyond / rules[ONSET, k])


@compiled
def ramp(k: int, innovation: float, state: Floats, dt: float) -> None:
    """How far signal `k` has left its trend within EXPLAINED: noise does not add up in it, the next sample takes it back."""
    left = innovation + math.exp(-dt / EXPLAINED) * state[RAMP, k]
    state[RAMP, k] = left if state[FAULTY, k] == 0.0 else 0.0


@compiled
def pitched(upwards: bool, rules: Floats, state: Floats) -> float:
    """How much the pitch rates show of a moment that set in, in onsets; upwards: one that raises the load and pitches the nose down.

    A lever that is thrown or let go accelerates arm and bucket at once, and their pressures jump. The frame answers with an
    angular acceleration: its rate grows with time, and from one sample to the next by less than noise.
    """
    sign = 1.0 if upwards else -1.0
    gyro = sign * state[RAMP, PITCH_RATE] / rules[ONSET, PITCH_RATE]
    slope = sign * state[RAMP, SLOPE_RATE] / rules[ONSET, SLOPE_RATE]
    return max(gyro, slope, 0.0)


@compiled
def threshold(k: int, own: int, rules: Floats, state: Floats) -> float:
    """The innovation from which on a sample of signal `k` is a jump: noise, and what the rest of the machine feels.

    What moves the machine moves signals of several messages. Each sensor has its onset: how far it goes when the machine
    sets in. REACH says how many times more onsets one signal may show than the most stirred one of the other messages.
    """
    others = 0.0
    for i in range(state.shape[1]):
        if i != own:
            others = max(others, state[STIR, i])
    return max(rules[JUMP, k] + REACH * others * rules[ONSET, k], LIVELY * state[LEVEL, k])


@compiled
def sample(k: int, m: Floats, innovation: float, rules: Floats, state: Floats) -> int:
    """Take one sample over; 1 if its signal turned faulty."""
    far = abs(innovation) > state[THRESHOLD, k]
    found = 0
    if far and not (TORQUE <= k < TORQUE + 4 and follower(k, m, state)):
        if state[MODE, k] == BY_FREEZE:
            state[JUMPED, k] = 0.0
            state[FAULTY, k], state[MODE, k] = 0.0, SOUND
        else:
            still = state[EVER, k] >= HELD_STILL
            state[JUMPED, k] = 0.0 if still else state[JUMPED, k] + innovation
            if state[FAULTY, k] == 0.0:
                state[LARGEST, k] = max(state[LARGEST, k], abs(innovation))
                state[SUSPECTED, k] = max(state[SUSPECTED, k], 1e-9)
            else:
                placed(k, rules, state)
    elif not far:
        if state[SINCE, k] < 0.0:
            state[FAULTY, k], state[MODE, k], state[JUMPED, k], state[SINCE, k] = 0.0, SOUND, 0.0, 0.0
        state[LEVEL, k] += MEMORY * (abs(innovation) - state[LEVEL, k])
        state[TREND, k] += FOLLOW * innovation
    state[EVER, k] = state[SAME, k]
    state[LAST, k], state[GAP, k] = m[k], 0.0
    return found


@compiled
def suspected(k: int, message: Integers, rules: Floats, state: Floats, dt: float) -> int:
    """A jump that waits for the rest of the machine to explain it; 1 if its time is over and it turned into a fault."""
    explained = state[THRESHOLD, k]
    if k in (LIFT, TILT):
        # in proportion, by pose, and no REACH: what both feel has had its time
        moment = pitched(state[JUMPED, k] > 0.0, rules, state)
        explained = max(explained, rules[JUMP, k] + POSE * moment * rules[ONSET, k])
    if state[LARGEST, k] <= explained or state[FAULTY, k] != 0.0:
        state[SUSPECTED, k] = state[LARGEST, k] = 0.0
        if state[FAULTY, k] == 0.0:
            state[JUMPED, k] = 0.0
        return 0
    state[SUSPECTED, k] += dt
    if not over(state[SUSPECTED, k], EXPLAINED):
        return 0
    state[SUSPECTED, k] = state[LARGEST, k] = 0.0
    state[FAULTY, k] = 1.0
    state[STIR, message[k]] = 0.0  # it was no motion of the machine
    placed(k, rules, state)
    return 1


@compiled
def placed(k: int, rules: Floats, state: Floats) -> None:
    """Whether a signal with jumps is away from where it was, or back and sound from the next sample on."""
    away = abs(state[JUMPED, k]) > rules[JUMP, k] / 2.0
    if away or state[MODE, k] == SOUND:
        state[MODE, k] = BY_JUMP
    state[SINCE, k] = 0.0 if away else -1.0


@compiled
def follower(k: int, m: Floats, state: Floats) -> bool:
    """Whether the other wheel of the axle is asked for the same: the drive moves both torques."""
    other = k + 1 if (k - TORQUE) % 2 == 0 else k - 1
    own, beside = m[k] - state[LAST, k], m[other] - state[LAST, other]
    return own * beside > 0.0 and abs(beside) > abs(own) / 3.0


@compiled
def standstill(heard: Integers, rules: Floats, state: Floats) -> int:
    """Signals that stand still to the bit while most others move; how many turned faulty."""
    still = 0
    for k in range(COUNT):
        still += 1 if state[SAME, k] >= rules[FREEZE, k] / 4.0 else 0
    found = 0
    for k in range(COUNT):
        if heard[k] != SAMPLE:
            continue
        if state[SAME, k] >= rules[FREEZE, k] and 2 * still < COUNT:
            found += 1 if state[FAULTY, k] == 0.0 else 0
            state[FAULTY, k], state[MODE, k], state[SINCE, k], state[JUMPED, k] = 1.0, BY_FREEZE, 0.0, 0.0
        elif state[MODE, k] == BY_FREEZE and state[SAME, k] == 0.0:
            state[FAULTY, k], state[MODE, k] = 0.0, SOUND
    return found
