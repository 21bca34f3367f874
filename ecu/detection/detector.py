"""The detection's cycle: samples in, which signals are faulty and how that was found out.

Pure and compiled: state and results are arrays, see `ecu.detection.layout`. The live loop calls `step` once per cycle, a
study calls `columns` over whole recordings.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ecu.detection.changes import remembered
from ecu.detection.compiled import compiled
from ecu.detection.isolation import QUIET, isolate, sensitivities, test
from ecu.detection.jumps import look
from ecu.detection.layout import (
    BY_JUMP,
    BY_RESIDUAL,
    F_LAST_YAW,
    F_SPEED,
    F_WARM,
    FAULTY,
    FILTERS,
    JUMPED,
    LAST,
    MODE,
    RESIDUALS,
    ROWS,
    SINCE,
    SOUND,
    SUSPECTED,
    THRESHOLD,
    UNDECIDED,
    WIDTH,
)  # fmt: skip
from ecu.detection.machine import NOTHING, over
from ecu.detection.residuals import residuals
from ecu.detection_rules import Tolerances
from ecu.estimators.parameters import Parameters
from ecu.watched import COUNT, YAW_RATE

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
LONGEST = 10.0
"""A jump that nothing contradicts and that is not taken back is believed after so long [s]."""


def initial() -> Floats:
    """The state before the first cycle."""
    return np.zeros((ROWS, WIDTH))


@compiled
def step(
    m: Floats,
    heard: Integers,
    usable: Floats,
    message: Integers,
    p: Parameters,
    t: Tolerances,
    rules: Floats,
    height: float,
    state: Floats,
    dt: float,
    r: Floats,
    bound: Floats,
) -> int:
    """One cycle; returns how many signals turned faulty.

    m: samples, SI, (COUNT,); heard: 1 where one came in this cycle; usable: 0 where other checks reject it;
    message: number of each signal's message; rules: see `ecu.detection.rules`; height: of the sequential tests.
    r, bound: residuals and bounds, written.
    """
    if state[FILTERS, F_WARM] == 0.0:
        for k in range(COUNT):
            state[LAST, k] = m[k]
    found = look(m, heard, message, rules, state, dt)
    residuals(m, usable, p, t, rules, state, dt, r, bound)
    state[FILTERS, F_WARM] += dt
    sensitive = np.empty((RESIDUALS, COUNT))
    sensitivities(m, state[FILTERS, F_SPEED], p, sensitive)
    fired = test(m, usable, sensitive, rules, height, state, dt, r, bound)
    remembered(m, bound, rules, state, dt)
    found += isolate(fired, sensitive, rules, state, bound, dt)
    aged(sensitive, state, bound, r, dt)
    return found


@compiled
def aged(sensitive: Floats, state: Floats, bound: Floats, r: Floats, dt: float) -> None:
    """Faults that are over: those of residuals after a quiet time, jumps that were never taken back after LONGEST."""
    for k in range(COUNT):
        if state[FAULTY, k] == 0.0 or state[SINCE, k] < 0.0:
            continue
        state[SINCE, k] += dt
        mode = state[MODE, k]
        if mode in (BY_RESIDUAL, UNDECIDED):
            for j in range(RESIDUALS):
                if sensitive[j, k] != 0.0 and bound[j] < NOTHING and abs(r[j]) > bound[j]:
                    state[SINCE, k] = 0.0
            if over(state[SINCE, k], QUIET):
                state[FAULTY, k], state[MODE, k] = 0.0, SOUND
        elif mode == BY_JUMP and over(state[SINCE, k], LONGEST):
            if k == YAW_RATE:  # the offset is believed from now on, but the machine does not turn faster now
                state[FILTERS, F_LAST_YAW] += state[JUMPED, k]
            state[FAULTY, k], state[MODE, k], state[JUMPED, k] = 0.0, SOUND, 0.0


@compiled
def cycles(
    m: Floats,
    heard: Integers,
    usable: Floats,
    message: Integers,
    p: Parameters,
    t: Tolerances,
    rules: Floats,
    height: float,
    state: Floats,
    dt: Floats,
    r: Floats,
    bound: Floats,
) -> Iterator[int]:
    """The live loop's: each step reads the arrays anew and yields how many signals are faulty or suspected; dt: (1,)."""
    while True:
        step(m, heard, usable, message, p, t, rules, height, state, dt[0], r, bound)
        faulty = 0
        for k in range(COUNT):
            faulty += 1 if state[FAULTY, k] != 0.0 or state[SUSPECTED, k] > 0.0 else 0
        yield faulty


@compiled
def columns(
    rows: Floats,
    heard: Integers,
    usable: Floats,
    message: Integers,
    p: Parameters,
    t: Tolerances,
    rules: Floats,
    height: float,
    state: Floats,
    modes: Integers,
    thresholds: Floats,
    r: Floats,
    bound: Floats,
) -> None:
    """Many cycles of 10 ms: heard and usable as of `step`, (n, COUNT); modes (n, COUNT), 0 where a signal is sound; thresholds of jumps, likewise; r and bound, (n, RESIDUALS)."""
    for i in range(rows.shape[0]):
        step(rows[i], heard[i], usable[i], message, p, t, rules, height, state, 0.01, r[i], bound[i])
        for k in range(COUNT):
            modes[i, k] = int(state[MODE, k]) if state[FAULTY, k] != 0.0 else 0
            thresholds[i, k] = state[THRESHOLD, k]
