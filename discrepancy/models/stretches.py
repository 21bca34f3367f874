"""Which stretches of a loader's recording are worth simulating: rolling ones, as different from one another as there are.

Ten minutes of driving repeat themselves; what a left-out effect shows, it shows in a few seconds of each way of driving. Wheels that
stop or start are left out: what a brake holds at a standstill depends on how it came to rest, which no sensor tells.
"""

from collections.abc import Mapping
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from discrepancy.recording import Array, Recording
from discrepancy.windows import resampled

SCORED_S: Final = 4.0  # of a stretch
SHORTEST_S: Final = 2.0
LEAD_S: Final = 2.5  # before it, for the motion to forget how it was begun
MOST_S: Final = 60.0  # scored of one recording
STEP_S: Final = 0.02
ROLLING: Final = 0.5  # wheel speed from which a wheel surely rolls [rad/s]

Interval = tuple[float, float]


def stretches(
    recording: Recording, interval: Interval, wheels: tuple[str, ...], told: tuple[str, ...]
) -> list[Interval]:
    """Stretches to score within `interval`, in order of time, together at most MOST_S.

    wheels: channels of wheel speed; told: channels by which ways of driving differ. A recording in which nothing rolls for long
    enough, or without wheel speeds, is cut without choosing.
    """
    start, end = interval
    grid: Array = start + STEP_S * np.arange(int((end - start) / STEP_S) + 1, dtype=np.float64)
    signals = {n: resampled(recording.signals[n], grid) for n in (*wheels, *told) if n in recording.signals}
    rolling = np.ones(grid.size, bool)
    for name in wheels:
        if name in signals:
            rolling &= np.abs(signals[name]) > ROLLING
    found = [part for low, high in _runs(rolling, grid) for part in _cut(low + LEAD_S, high)]
    if not found:
        found = _cut(start, end)
    most = max(1, int(MOST_S / SCORED_S))
    if len(found) <= most:
        return found
    return [found[i] for i in sorted(_most_different(_ways(found, grid, signals), most))]


def _runs(where: NDArray[np.bool_], grid: Array) -> list[Interval]:
    """First and last time of every run of True."""
    return [(float(grid[run.start]), float(grid[run.stop - 1])) for run in runs_of(where)]


def runs_of(where: NDArray[np.bool_]) -> list[range]:
    """Rows of every run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], where, [False])).astype(int)))
    return [range(a, b) for a, b in edges.reshape(-1, 2).tolist()]


def _cut(low: float, high: float) -> list[Interval]:
    """Parts of about SCORED_S."""
    if high - low < SHORTEST_S:
        return []
    edges = np.linspace(low, high, max(1, round((high - low) / SCORED_S)) + 1)
    return list(pairwise(edges.tolist()))


def _ways(found: list[Interval], grid: Array, signals: Mapping[str, Array]) -> Array:
    """Each stretch by the mean and the spread of every signal, in units of their spread over all stretches (n, features)."""
    rows = []
    for low, high in found:
        inside = (grid >= low) & (grid <= high)
        rows.append([f(values[inside]) for values in signals.values() for f in (np.mean, np.std)])
    ways = np.array(rows)
    return np.asarray((ways - np.mean(ways, axis=0)) / np.maximum(np.std(ways, axis=0), 1e-9), float)


def _most_different(ways: Array, count: int) -> list[int]:
    """Farthest-point choice (Gonzalez 1985), begun with the most unusual: no way of driving is far from a chosen one."""
    chosen = [int(np.argmax(np.sum(ways**2, axis=1)))]
    nearest = np.sum((ways - ways[chosen[0]]) ** 2, axis=1)
    while len(chosen) < count:
        chosen.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, np.sum((ways - ways[chosen[-1]]) ** 2, axis=1))
    return chosen
