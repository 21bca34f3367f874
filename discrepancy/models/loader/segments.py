"""Segments of a loader's recording that are simulated and scored: with rolling wheels, and as different from one another as possible.

Ten minutes of driving repeat themselves, and an effect shows in a few seconds of every manoeuvre. Wheels that stop or start are left
out: the torque that a brake holds at a standstill depends on how the machine came to rest, which no sensor measures.
"""

from collections.abc import Mapping
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from discrepancy.signals.recording import Array, Recording
from discrepancy.signals.resampling import resampled

SCORED_S: Final = 4.0  # length of a segment, without its lead-in
SHORTEST_S: Final = 2.0  # of a segment: a shorter one is mostly initial state
LEAD_S: Final = 2.5  # lead-in before a segment, in which errors of the initial state decay
MOST_S: Final = 60.0  # scored of one recording: bounds the cost of long recordings
STEP_S: Final = 0.02  # of the grid on which segments are chosen
ROLLING: Final = 0.5  # wheel speed from which on a wheel surely rolls [rad/s]

Interval = tuple[float, float]
"""First and last time [s]."""


def choose_segments(
    recording: Recording, interval: Interval, wheels: tuple[str, ...], features: tuple[str, ...]
) -> list[Interval]:
    """Segments to score within `interval`, in order of time, together at most MOST_S.

    wheels: channels of wheel speed; features: channels by which manoeuvres differ. A recording in which no wheel rolls for long
    enough, or without wheel speeds, is cut without a choice.
    """
    start, end = interval
    grid: Array = start + STEP_S * np.arange(int((end - start) / STEP_S) + 1, dtype=np.float64)
    signals = {
        n: resampled(recording.signals[n], grid) for n in (*wheels, *features) if n in recording.signals
    }
    rolling = np.ones(grid.size, bool)
    for name in wheels:
        if name in signals:
            rolling &= np.abs(signals[name]) > ROLLING
    spans = [(float(grid[rows.start]), float(grid[rows.stop - 1])) for rows in row_ranges(rolling)]
    segments = [part for low, high in spans for part in _cut(low + LEAD_S, high)]
    if not segments:
        segments = _cut(start, end)
    most = max(1, int(MOST_S / SCORED_S))
    if len(segments) <= most:
        return segments
    return [segments[i] for i in sorted(_most_different(_features(segments, grid, signals), most))]


def row_ranges(where: NDArray[np.bool_]) -> list[range]:
    """Ranges of consecutive rows in which `where` is True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], where, [False])).astype(int)))
    return [range(a, b) for a, b in edges.reshape(-1, 2).tolist()]


def _cut(low: float, high: float) -> list[Interval]:
    """Parts of about SCORED_S; none where the interval is too short."""
    if high - low < SHORTEST_S:
        return []
    edges = np.linspace(low, high, max(1, round((high - low) / SCORED_S)) + 1)
    return list(pairwise(edges.tolist()))


def _features(segments: list[Interval], grid: Array, signals: Mapping[str, Array]) -> Array:
    """Mean and spread of every signal in each segment, standardised over all segments (n, features)."""
    rows = []
    for low, high in segments:
        inside = (grid >= low) & (grid <= high)
        rows.append([f(values[inside]) for values in signals.values() for f in (np.mean, np.std)])
    features = np.array(rows)
    return np.asarray(
        (features - np.mean(features, axis=0)) / np.maximum(np.std(features, axis=0), 1e-9), float
    )


def _most_different(features: Array, count: int) -> list[int]:
    """Farthest-point choice (Gonzalez 1985), from the most unusual segment on: every manoeuvre is near a chosen one."""
    chosen = [int(np.argmax(np.sum(features**2, axis=1)))]
    nearest = np.sum((features - features[chosen[0]]) ** 2, axis=1)
    while len(chosen) < count:
        chosen.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, np.sum((features - features[chosen[-1]]) ** 2, axis=1))
    return chosen
