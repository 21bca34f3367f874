"""Divides rows by time and by regime: bins of time in each recording, and thirds of the distribution of a known signal."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from discrepancy.estimation.noise import Noise
from discrepancy.estimation.problem import Problem
from discrepancy.signals.quantities import figures, readable
from discrepancy.signals.recording import Array

BINS = 60  # of time, per recording


@dataclass(frozen=True, slots=True)
class TimeBins:
    """Whitened rows of one recording, in bins of equal length."""

    recording: str
    rows: NDArray[np.bool_]  # mask of its rows among all whitened rows (n,)
    edges_s: Array  # (BINS + 1,)
    bin_of: NDArray[np.intp]  # bin of each of its rows

    def summed(self, values: Array) -> Array:
        """Sum of a value per whitened row in each bin (BINS,)."""
        return np.asarray(np.bincount(self.bin_of, values[self.rows], BINS), float)


def time_bins(problem: Problem, noise: Noise) -> Iterator[TimeBins]:
    """One per recording, in order."""
    owner = np.array([w.recording for w in problem.windows])[noise.row_window]
    for recording in dict.fromkeys(w.recording for w in problem.windows):
        rows = owner == recording
        time_s = noise.row_time[rows]
        edges = np.linspace(time_s.min(), time_s.max() + 1e-9, BINS + 1)
        yield TimeBins(recording, rows, edges, np.clip(np.digitize(time_s, edges) - 1, 0, BINS - 1))


def regimes_of(
    problem: Problem, noise: Noise, name: str, unit: str
) -> tuple[str, dict[str, NDArray[np.bool_]]]:
    """The unit in which the thirds of a known signal are described, and the rows in each of them by its description."""
    value = at_rows(problem, noise, name)
    factor, described = readable(unit, float(np.max(np.abs(value))))
    return described, thirds(value / factor)


def thirds(value: Array) -> dict[str, NDArray[np.bool_]]:
    """Masks of the rows in each third of a signal's distribution, by description; for a signal that mostly rests: at rest, below, above."""
    # quantiles instead of equal parts of the range: every third then has rows, also with a single spike in the signal
    low, high = np.quantile(value, [1 / 3, 2 / 3])
    found = {
        f"below {figures(low)}": value < low,
        f"{figures(low)} to {figures(high)}" if low < high else f"at {figures(low)}": (value >= low)
        & (value <= high),
        f"above {figures(high)}": value > high,
    }
    return {text: rows for text, rows in found.items() if rows.any()} if np.ptp(value) > 0.0 else {}


def at_rows(problem: Problem, noise: Noise, name: str) -> Array:
    """An input or measured output at each whitened row, in its own unit."""
    value = np.empty(noise.keep.size)
    for i, window in enumerate(problem.windows):
        rows = noise.row_window == i
        value[rows] = np.interp(noise.row_time[rows], window.time_s, window[name])
    return value
