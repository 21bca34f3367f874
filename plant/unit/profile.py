"""A quantity over time: straight lines between points, plus sines."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from configuration import CheckedTable
from plant.compiled import ruled

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sine:
    """amplitude sin(2 pi frequency (t - start)) from start until end, else nothing."""

    amplitude: float
    frequency_hz: float
    start_s: float = 0.0
    end_s: float = math.inf


class Curves(NamedTuple):
    """Several profiles as numbers, for compiled code."""

    times: Floats  # of all points, one profile after the other [s]
    values: Floats  # at them
    starts: NDArray[np.int64]  # of each profile among the points; one more at the end
    sines: Floats  # a row for each profile: amplitude, frequency [Hz], start and end [s]


@ruled
def value_at(curves: Curves, which: int, time: float) -> float:
    """Value of one profile at `time` [s]; of one without points 0."""
    first, last = curves.starts[which], curves.starts[which + 1]
    if first == last:
        return 0.0
    amplitude, frequency, start, end = curves.sines[which]
    line = _line(curves.times, curves.values, first, last, time)
    if amplitude == 0.0 or not start <= time < end:
        return line
    return line + amplitude * math.sin(2 * math.pi * frequency * (time - start))


@ruled
def _line(times: Floats, values: Floats, first: int, last: int, time: float) -> float:
    """Between the points `first` and before `last`."""
    # halving; `after` becomes the first point behind this time, whatever stands at the time itself
    after, behind = first, last
    while after < behind:
        middle = (after + behind) // 2
        if times[middle] <= time:
            after = middle + 1
        else:
            behind = middle
    if after == first:
        return values[first]
    if after == last:
        return values[last - 1]
    t0, t1, v0, v1 = times[after - 1], times[after], values[after - 1], values[after]
    return v0 + (v1 - v0) * (time - t0) / (t1 - t0)


@dataclass(frozen=True, slots=True)
class Profile:
    """Straight lines between (time [s], value) points, the first and last held beyond them, plus a sine.

    Two points at one time are a step: the later one holds from that time on.
    """

    points: tuple[tuple[float, float], ...]
    sine: Sine | None = None

    @classmethod
    def read(cls, table: CheckedTable, *, unit: str, si: float, low: float, high: float) -> Self:
        """From a table with `points` and, if wanted, `sine`; values in `unit`, of size `si` in SI."""
        points = tuple((t, v * si) for t, v in table.points("points", unit=unit, low=low, high=high))
        sine = None
        if "sine" in table:
            entry = table.table("sine")
            start = entry.number("start_s", unit="s", low=0.0, default=0.0)
            sine = Sine(
                amplitude=entry.number("amplitude", unit=unit, low=low, high=high) * si,
                frequency_hz=entry.number("frequency_hz", unit="Hz", low=0.001, high=10.0),
                start_s=start,
                end_s=entry.number("end_s", unit="s", low=start, default=math.inf),
            )
            entry.finish()
        table.finish()
        return cls(points, sine)


def curves_of(profiles: Sequence[Profile | None]) -> Curves:
    """Profiles as numbers, in their order; None is one without points."""
    points = [() if profile is None else profile.points for profile in profiles]
    sines = [
        Sine(amplitude=0.0, frequency_hz=0.0) if p is None or p.sine is None else p.sine for p in profiles
    ]
    times, values = np.array([point for some in points for point in some], np.float64).reshape(-1, 2).T.copy()
    return Curves(
        times,
        values,
        np.cumsum([0, *map(len, points)]),
        np.array([(s.amplitude, s.frequency_hz, s.start_s, s.end_s) for s in sines]),
    )
