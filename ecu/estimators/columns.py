"""The estimators over whole recordings: the live loop's functions, row by row, compiled.

Only the present carries a state from row to row, and it takes a tenth of the time. So one thread runs through the present,
block by block, and keeps the state before each row; the other cores compute whole rows of the blocks behind it, each
from its own state. The functions are the same, and so are the results, bit by bit (ADR 56).
"""

import os
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Literal

import numpy as np
from numba.np.unsafe import ndarray as unsafe
from numpy.typing import NDArray

from ecu.estimators.compiled import compiled, released
from ecu.estimators.estimate import corrected, corrected_now, present
from ecu.estimators.parameters import Parameters
from ecu.estimators.printed.estimate import printed
from ecu.estimators.printed.state import PRINTED_INITIAL, PrintedState
from ecu.estimators.signals import Estimates, Inputs
from ecu.estimators.state import INITIAL, State

Floats = NDArray[np.float64]
INPUTS = len(Inputs._fields)
ESTIMATES = len(Estimates._fields)
STATES = len(State._fields)
BLOCK = 2048
"""Rows that a thread computes at a time: some 20 ms, beside which handing them over takes nothing."""

to_fixed_tuple: Any = unsafe.to_fixed_tuple  # an intrinsic; its annotations are those of its typing function


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
        workers = len(os.sched_getaffinity(0)) if cores is None else cores
        # below two blocks the second thread would have nothing to do
        if workers < 2 or len(rows) < 2 * BLOCK:
            corrected_rows(rows, parameters, INITIAL, out)
        else:
            _corrected_blocks(rows, parameters, out, workers)
    return out


def _corrected_blocks(rows: Floats, parameters: Parameters, out: Floats, workers: int) -> None:
    """The corrected estimators on several cores."""
    before = np.array(INITIAL)
    with ThreadPoolExecutor(workers) as pool:
        running: deque[Future[None]] = deque()
        for first in range(0, len(rows), BLOCK):
            part = slice(first, first + BLOCK)
            states = np.empty((len(rows[part]) + 1, STATES))
            states[0] = before
            states_of(rows[part], parameters, states)
            before = states[-1]
            running.append(pool.submit(corrected_from, rows[part], states, parameters, out[part]))
            # the present is ten times as fast as the rest: without a bound all states would wait in memory
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
def states_of(rows: Floats, parameters: Parameters, states: Floats) -> None:
    """The states before each row and after the last one, (n + 1, STATES), from the first of them."""
    state = State(*to_fixed_tuple(states[0], STATES))
    for k in range(rows.shape[0]):
        _, state = present(Inputs(*to_fixed_tuple(rows[k], INPUTS)), state, parameters)
        for j in range(STATES):
            states[k + 1, j] = state[j]


@released
def corrected_from(rows: Floats, states: Floats, parameters: Parameters, out: Floats) -> None:
    """The corrected estimators, each row from the state before it."""
    for k in range(rows.shape[0]):
        state = State(*to_fixed_tuple(states[k], STATES))
        estimates, _ = corrected(Inputs(*to_fixed_tuple(rows[k], INPUTS)), state, parameters)
        for j in range(ESTIMATES):
            out[k, j] = estimates[j]


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
