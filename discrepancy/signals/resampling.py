"""Signals on a time grid: what they are between their samples.

A held signal keeps its value until the next sample. One that is not held goes straight from sample to sample, or on a cubic spline where that predicts better what is known.
Straight lines cut the tops off a smooth signal that was sampled coarsely. That looks like a lag of what the signal drives.
"""

from collections.abc import Callable, Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from discrepancy import gates
from discrepancy.signals.recording import Array, Signal

# in usual pauses between samples: no curve is drawn through a longer one, and a new block of the whitening filter starts
GAP: Final = 3.5
# of a grid step, by which a held value may be stamped beside a grid point and be of it
HOLD_TOLERANCE: Final = 1e-3
# samples of a part without gaps that is drawn as a curve
FEWEST: Final = int(gates.SAMPLES_IN_A_BLOCK.threshold)

Course = Callable[[Array], Array]
"""Values of a signal on a grid: times [s] (n,), even and increasing -> (n,)."""


def resampled(source: Signal, grid: Array) -> Array:
    """Values on one grid; `course` is for several."""
    return course(source)(grid)


def course(source: Signal) -> Course:
    """Values on any grid: of held signals the mean over the step that begins there, of others straight or curved between samples. Beyond its ends a signal is constant."""
    if source.held:
        return lambda grid: _means_over_steps(source, grid)
    curves = [CubicSpline(t, y) for t, y in _without_gaps(source)] if is_smooth(source) else []

    def values(grid: Array) -> Array:
        found = np.interp(grid, source.time_s, source.value)
        for curve in curves:
            inside = slice(
                np.searchsorted(grid, curve.x[0]), np.searchsorted(grid, curve.x[-1], side="right")
            )
            found[inside] = curve(grid[inside])
        return found

    return values


def is_smooth(source: Signal) -> bool:
    """Whether a cubic spline through every second sample predicts the others with less squared error than straight lines do.

    At twice the distance a curve loses more by noise, and by jumps, than it would between the samples.
    """
    straight = curved = 0.0
    for t, y in _without_gaps(source):
        for first in (0, 1):
            knots = slice(first, None, 2)
            left_out = slice(first + 1, first + 2 * len(t[knots]) - 2, 2)
            lines = np.interp(t[left_out], t[knots], y[knots])
            straight += float(np.sum((lines - y[left_out]) ** 2))
            curve = CubicSpline(t[knots], y[knots])
            curved += float(np.sum((curve(t[left_out]) - y[left_out]) ** 2))
    return curved < straight


def _without_gaps(source: Signal) -> Iterator[tuple[Array, Array]]:
    """Stamps and values of each part that has no gap and enough samples for a curve."""
    pauses = np.diff(source.time_s)
    if not pauses.size:
        return
    # The upper quartile, not the median: samples may come in bursts, with every other pause a long one.
    at = np.flatnonzero(pauses > GAP * np.quantile(pauses, 0.75)) + 1
    for t, y in zip(np.split(source.time_s, at), np.split(source.value, at), strict=True):
        if t.size >= FEWEST:
            yield t, y


def _means_over_steps(source: Signal, grid: Array) -> Array:
    if grid.size < 2:
        return source.value[_last_before(source.time_s, grid)]
    # A command that comes within a step acts for the rest of it. Its value at the grid point would act up to a step late.
    # by many steps: stamps that count from 1970 are rounded to 0.24 µs
    step = (grid[-1] - grid[0]) / (grid.size - 1)
    places = (source.time_s - grid[0]) / step
    # no value may stand a step too long for such rounding
    whole = np.round(places)
    places = np.where(np.abs(places - whole) < HOLD_TOLERANCE, whole, places)
    changes = places[(places > 0.0) & (places < grid.size)]
    points = np.union1d(np.arange(grid.size + 1.0), changes)
    values = source.value[_last_before(places, points[:-1])]
    return np.asarray(np.bincount(points[:-1].astype(np.intp), np.diff(points) * values, grid.size), float)


def _last_before(places: Array, points: Array) -> NDArray[np.intp]:
    """Index of the last value at or before each point; the first one where there is none."""
    return np.clip(np.searchsorted(places, points, side="right") - 1, 0, None)
