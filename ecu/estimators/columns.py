"""The estimators over whole recordings: the live loop's functions, row by row, compiled."""

from typing import Any, Literal

import numpy as np
from numba.np.unsafe import ndarray as unsafe
from numpy.typing import NDArray

from ecu.estimators.compiled import compiled
from ecu.estimators.estimate import INITIAL, Estimates, Inputs, State, corrected, printed
from ecu.estimators.parameters import Parameters

Floats = NDArray[np.float64]
INPUTS = len(Inputs._fields)
ESTIMATES = len(Estimates._fields)

to_fixed_tuple: Any = unsafe.to_fixed_tuple  # an intrinsic; its annotations are those of its typing function


def estimate_columns(
    inputs: Floats, parameters: Parameters, *, form: Literal["corrected", "printed"] = "corrected"
) -> Floats:
    """Estimates, shape (n, len(Estimates._fields)), of inputs of shape (n, len(Inputs._fields)).

    The rows are consecutive cycles; the state starts at its initial value.
    """
    if inputs.ndim != 2 or inputs.shape[1] != INPUTS:
        raise ValueError(f"inputs have shape {inputs.shape}; expected (n, {INPUTS}), the fields of Inputs")
    rows = np.ascontiguousarray(inputs, dtype=np.float64)
    out = np.empty((len(rows), ESTIMATES))
    (_corrected_rows if form == "corrected" else _printed_rows)(rows, parameters, INITIAL, out)
    return out


@compiled
def _corrected_rows(rows: Floats, parameters: Parameters, state: State, out: Floats) -> None:
    for k in range(rows.shape[0]):
        estimates, state = corrected(Inputs(*to_fixed_tuple(rows[k], INPUTS)), state, parameters)
        for j in range(ESTIMATES):
            out[k, j] = estimates[j]


@compiled
def _printed_rows(rows: Floats, parameters: Parameters, state: State, out: Floats) -> None:
    for k in range(rows.shape[0]):
        estimates, state = printed(Inputs(*to_fixed_tuple(rows[k], INPUTS)), state, parameters)
        for j in range(ESTIMATES):
            out[k, j] = estimates[j]
