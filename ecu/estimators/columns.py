"""The estimators over whole recordings: the live loop's functions, row by row, compiled.

Only the present carries a state from row to row, and it takes a part of the time. So one thread runs through the present,
block by block, and keeps what each row's prediction starts from; the other cores predict in the blocks behind it
(ADR 56). The predictions of a block are made side by side (`outlook`, ADR 81). The functions are the same, and so are
the results, bit by bit.
"""

import os
from collections import deque
from concurrent import futures as threads
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ecu.estimators.compiled import compiled, released
from ecu.estimators.estimate import (
    NOT_PREDICTED,
    Future,
    corrected,
    corrected_now,
    estimates_of,
    present,
)
from ecu.estimators.outlook import CASES, Case, case_in, futures, put_case
from ecu.estimators.parameters import Parameters
from ecu.estimators.printed.estimate import printed
from ecu.estimators.printed.state import PRINTED_INITIAL, PrintedState
from ecu.estimators.rows import ESTIMATES, INPUTS, STATES, to_fixed_tuple
from ecu.estimators.signals import Estimates, Inputs
from ecu.estimators.stability import rollover
from ecu.estimators.stability.loading import loading_of
from ecu.estimators.state import INITIAL, State

Floats = NDArray[np.float64]
BLOCK = 2048
"""Rows that a thread computes at a time: some 20 ms, beside which handing them over takes nothing."""

TOGETHER = 128
"""Rows whose predictions are made together: more fill the vectors better, fewer stay in the processor's cache."""

LTR_AHEAD, MARGIN_AHEAD, LIFT_OFF, LIFTING, RATE, DIRECTION, SPEED, LEVER, MOTION = map(
    Estimates._fields.index,
    (
        "predicted_load_transfer_ratio", "predicted_margin", "time_to_lift_off", "lifting_wheel", "permitted_rate",
        "permitted_direction", "permitted_speed", "permitted_lever", "permitted_motion",
    ),
)  # fmt: skip
"""Columns of the estimates that a Future fills."""


def estimate_columns(
    inputs: Floats,
    parameters: Parameters,
    *,
    form: Literal["corrected", "printed"] = "corrected",
    prediction: bool = True,
    cores: int | None = None,
) -> Floats:
    """Estimates, shape (n, len(Estimates._fields)), of inputs of shape (n, len(Inputs._fields)).

    The rows are consecutive cycles; the state starts at its initial value. prediction: False leaves out
    the prediction (NaN), which takes most of the time. cores: that compute it; None: all that this process may use. The
    result does not depend on them. Where an estimator fails, its error is raised (ZeroDivisionError, ValueError).
    """
    if inputs.ndim != 2 or inputs.shape[1] != INPUTS:
        raise ValueError(f"inputs have shape {inputs.shape}; expected (n, {INPUTS}), the fields of Inputs")
    rows = np.ascontiguousarray(inputs, dtype=np.float64)
    out = np.empty((len(rows), ESTIMATES))
    if form == "printed":
        printed_rows(rows, parameters, PRINTED_INITIAL, out)
    elif not prediction:
        present_rows(rows, parameters, INITIAL, out)
    else:
        # predictions side by side are other code to compile, which pays from some thousand rows on
        if len(rows) < 2 * BLOCK:
            corrected_rows(rows, parameters, INITIAL, out)
        else:
            _corrected_blocks(rows, parameters, out, len(os.sched_getaffinity(0)) if cores is None else cores)
    return out


def _corrected_blocks(rows: Floats, parameters: Parameters, out: Floats, workers: int) -> None:
    """The corrected estimators on one or several cores."""
    state = np.array(INITIAL)
    with threads.ThreadPoolExecutor(workers) as pool:
        running: deque[threads.Future[None]] = deque()
        for first in range(0, len(rows), BLOCK):
            part = slice(first, first + BLOCK)
            cases = np.empty((len(rows[part]), CASES))
            present_from(rows[part], parameters, state, cases, out[part])
            if workers < 2:
                outlook_from(cases, parameters, out[part])
                continue
            running.append(pool.submit(outlook_from, cases, parameters, out[part]))
            # the present is several times as fast as the rest: without a bound all cases would wait in memory
            if len(running) > 2 * workers:
                running.popleft().result()
        for block in running:
            block.result()


@compiled
def corrected_rows(rows: Floats, parameters: Parameters, state: State, out: Floats) -> None:
    """The corrected estimators, row by row."""
    for k in range(rows.shape[0]):
        estimates, state = corrected(Inputs(*to_fixed_tuple(rows[k], INPUTS)), state, parameters)
        for j in range(ESTIMATES):
            out[k, j] = estimates[j]


@released
def present_from(rows: Floats, parameters: Parameters, state: Floats, cases: Floats, out: Floats) -> None:
    """The present of each row into `out`, and what its prediction starts from into `cases`, shape (n, CASES).

    state: before the first row, replaced by that after the last one.
    """
    then = State(*to_fixed_tuple(state, STATES))
    for k in range(rows.shape[0]):
        i = Inputs(*to_fixed_tuple(rows[k], INPUTS))
        now, then = present(i, then, parameters)
        estimates = estimates_of(now, NOT_PREDICTED, parameters)
        for j in range(ESTIMATES):
            out[k, j] = estimates[j]
        put_case(cases[k], Case(now.start, loading_of(now.machine), float(now.motion), i.rate_limit))
    for j in range(STATES):
        state[j] = then[j]


@released
def outlook_from(cases: Floats, parameters: Parameters, out: Floats) -> None:
    """The prediction and the limits of each row into its estimates."""
    if cases.shape[0] == 0:
        return
    first = case_in(cases[0])
    machine = rollover.loaded_machine(first.loading.front, first.loading.payload, parameters)
    for begin in range(0, cases.shape[0], TOGETHER):
        then = futures([case_in(cases[k]) for k in range(begin, min(begin + TOGETHER, len(cases)))], machine)
        for k in range(len(then)):
            put_future(out[begin + k], then[k])


@compiled
def put_future(row: Floats, then: Future) -> None:
    """A prediction into a row of estimates."""
    row[LTR_AHEAD] = then.prediction.load_transfer_ratio
    row[MARGIN_AHEAD] = then.prediction.margin
    row[LIFT_OFF] = then.prediction.time_to_lift_off
    row[LIFTING] = then.prediction.wheel
    row[RATE] = then.permitted_rate
    row[DIRECTION] = then.permitted_direction
    row[SPEED] = then.permitted_speed
    row[LEVER] = then.permitted_lever
    row[MOTION] = then.permitted_motion


@compiled
def present_rows(rows: Floats, parameters: Parameters, state: State, out: Floats) -> None:
    """The corrected estimators without the prediction."""
    for k in range(rows.shape[0]):
        estimates, state = corrected_now(Inputs(*to_fixed_tuple(rows[k], INPUTS)), state, parameters)
        for j in range(ESTIMATES):
            out[k, j] = estimates[j]


@compiled
def printed_rows(rows: Floats, parameters: Parameters, state: PrintedState, out: Floats) -> None:
    """The estimators as printed."""
    for k in range(rows.shape[0]):
        estimates, state = printed(Inputs(*to_fixed_tuple(rows[k], INPUTS)), state, parameters)
        for j in range(ESTIMATES):
            out[k, j] = estimates[j]
