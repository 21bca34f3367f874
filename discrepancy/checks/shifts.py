"""Correlation of a prediction with a reading that is shifted in time, for the checks of channels and clocks."""

import numpy as np
from numpy.typing import NDArray

from discrepancy.estimation.fit import WindowStates
from discrepancy.estimation.problem import Problem
from discrepancy.signals.recording import Array


def shifted_correlation(
    problem: Problem,
    rows: NDArray[np.intp],
    base: Array,
    local: Array,
    source: tuple[Array, Array],
    shifts: NDArray[np.floating],
    *,
    centred: bool,
) -> Array:
    """Absolute correlation for each shift (shifts,), initial states projected out.

    rows: of one channel; base: predicted rows (N,); local: their derivatives by initial states (N, k); source: stamps and values of the
    channel, from which the shifted readings are interpolated; shifts: added to the stamps at which the source is read [s]; centred: subtract the
    means, for channels whose zero point may be wrong.
    """
    time_s = problem.row_time[rows]
    states = WindowStates(local[rows], problem.row_window[rows], np.ones(rows.size, bool))
    moved = np.stack([np.interp(time_s + s, *source) for s in shifts], axis=1)
    moved, predicted = states.off(moved), states.off(base[rows])
    if centred:
        moved, predicted = moved - np.mean(moved, axis=0), predicted - np.mean(predicted)
    size = np.sqrt(np.sum(moved**2, axis=0) * float(predicted @ predicted))
    return np.asarray(np.abs(moved.T @ predicted) / np.maximum(size, 1e-300), float)
