"""The estimators over whole recordings: the live loop's functions, row by row, compiled."""

from typing import Any, Literal

import numpy as np
from numba.np.unsafe import ndarray as unsafe
from numpy.typing import NDArray

from ecu.estimators.compiled import compiled
from ecu.estimators.estimate import corrected, corrected_now
from ecu.estimators.parameters import Parameters
from ecu.estimators.printed.estimate import printed
from ecu.estimators.printed.state import PRINTED_INITIAL, PrintedState
from ecu.estimators.signals import Estimates, Inputs
from ecu.estimators.state import INITIAL, State

Floats = NDArray[np.float64]
INPUTS = len(Inputs._fields)
ESTIMATES = len(Estimates._fields)

to_fixed_tuple: Any = unsafe.to_fixed_tuple  # an intrinsic; its annotations are those of its typing function


def estimate_columns(
    inputs: Floats,
    parameters: Parameters,
    *,
    form: Literal["corrected", "printed"] = "corrected",
    prediction: bool = True,
) -> Floats:
    """Estimates, shape (n, len(Estimates._fields)), of inputs of shape (n, len(Inputs._fields)).

    The rows are consecutive cycles; the state starts at its initial value. prediction: False leaves out
    the prediction (NaN), which takes most of the time.
    """
    if inputs.ndim != 2 or inputs.shape[1] != INPUTS:
        raise ValueError(f"inputs have shape {inputs.shape}; expected (n, {INPUTS}), the fields of Inputs")
    rows = np.ascontiguousarray(inputs, dtype=np.float64)
    out = np.empty((len(rows), ESTIMATES))
    if form == "printed":
        printed_rows(rows, parameters, PRINTED_INITIAL, out)
    else:
        (corrected_rows if prediction else present_rows)(rows, parameters, INITIAL, out)
    return out


@compiled
def corrected_rows(rows: Floats, parameters: Parameters, state: State, out: Floats) -> None:
    """The corrected estimators, row by row."""
    for k in range(rows.shape[0]):
        estimates, state = corrected(Inputs(*to_fixed_tuple(rows[k], INPUTS)), state, parameters)
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
