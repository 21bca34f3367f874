"""A quantity over time: straight lines between points, plus sines."""

import math
from bisect import bisect_right
from dataclasses import dataclass
from typing import Self

from configuration import CheckedTable


@dataclass(frozen=True, slots=True, kw_only=True)
class Sine:
    """amplitude sin(2 pi frequency (t - start)) from start until end, else nothing."""

    amplitude: float
    frequency_hz: float
    start_s: float = 0.0
    end_s: float = math.inf

    def at(self, time: float) -> float:
        """Value at `time` [s]."""
        if not self.start_s <= time < self.end_s:
            return 0.0
        return self.amplitude * math.sin(2 * math.pi * self.frequency_hz * (time - self.start_s))


@dataclass(frozen=True, slots=True)
class Profile:
    """Straight lines between (time [s], value) points, the first and last held beyond them, plus a sine.

    Two points at one time are a step: the later one holds from that time on.
    """

    points: tuple[tuple[float, float], ...]
    sine: Sine | None = None

    def at(self, time: float) -> float:
        """Value at `time` [s]."""
        base = self._line(time)
        return base if self.sine is None else base + self.sine.at(time)

    def _line(self, time: float) -> float:
        # behind every point at this time, whatever its value; without a function that takes the time out of each point
        after = bisect_right(self.points, (time, math.inf))
        if after == 0:
            return self.points[0][1]
        if after == len(self.points):
            return self.points[-1][1]
        (t0, v0), (t1, v1) = self.points[after - 1], self.points[after]
        return v0 + (v1 - v0) * (time - t0) / (t1 - t0)

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
