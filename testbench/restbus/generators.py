"""Signal generators: values over time for the signals of a rest bus. Pure."""

import bisect
import math
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, Protocol

from configuration import CheckedTable


class Generator(Protocol):
    """Gives the value of a signal, in the DBC's unit."""

    def value(self, time_s: float, sent: int) -> float:
        """time_s: since the rest bus started; sent: frames of the message sent before this one."""


@dataclass(frozen=True, slots=True)
class Constant:
    """The same value always."""

    level: float

    def value(self, time_s: float, sent: int) -> float:
        return self.level


@dataclass(frozen=True, slots=True)
class Sine:
    """offset + amplitude sin(2 pi t / period)."""

    amplitude: float
    offset: float
    period_s: float

    def value(self, time_s: float, sent: int) -> float:
        return self.offset + self.amplitude * math.sin(math.tau * time_s / self.period_s)


@dataclass(frozen=True, slots=True)
class Square:
    """`high` in the first half of each period, then `low`."""

    low: float
    high: float
    period_s: float

    def value(self, time_s: float, sent: int) -> float:
        return self.high if time_s % self.period_s < self.period_s / 2 else self.low


@dataclass(frozen=True, slots=True)
class Ramp:
    """From `low` to `high` in each period, then from the start again."""

    low: float
    high: float
    period_s: float

    def value(self, time_s: float, sent: int) -> float:
        return self.low + (self.high - self.low) * (time_s % self.period_s) / self.period_s


@dataclass(frozen=True, slots=True)
class Points:
    """Straight lines between (time [s], value); before the first and after the last point their values."""

    times_s: tuple[float, ...]
    values: tuple[float, ...]

    def value(self, time_s: float, sent: int) -> float:
        # right: at a point that stands twice (a step) the later value holds
        after = bisect.bisect_right(self.times_s, time_s)
        if after == 0:
            return self.values[0]
        if after == len(self.times_s):
            return self.values[-1]
        t0, t1 = self.times_s[after - 1 : after + 1]
        v0, v1 = self.values[after - 1 : after + 1]
        return v0 + (v1 - v0) * (time_s - t0) / (t1 - t0)


@dataclass(frozen=True, slots=True)
class Count:
    """Counts frames: 0, 1, ... modulo - 1, 0, ..."""

    modulo: int

    def value(self, time_s: float, sent: int) -> float:
        return float(sent % self.modulo)


@dataclass(frozen=True, slots=True)
class Noise:
    """Independent normal values; the same ones for the same seed and frame."""

    mean: float
    deviation: float
    seed: int

    def value(self, time_s: float, sent: int) -> float:
        # A generator per frame: what one message gets must not depend on when the others were sent.
        return random.Random(self.seed << 32 ^ sent).gauss(self.mean, self.deviation)


def _period(table: CheckedTable) -> float:
    return table.number("period_s", unit="s", low=1e-3, high=86_400.0)


def _points(table: CheckedTable) -> Generator:
    times_s, values = zip(*table.points("points", unit="1", low=-1e12, high=1e12), strict=True)
    return Points(times_s, values)


def _span(make: Callable[[float, float, float], Generator], table: CheckedTable) -> Generator:
    return make(table.number("low", unit="1"), table.number("high", unit="1"), _period(table))


KINDS: Final[Mapping[str, Callable[[CheckedTable], Generator]]] = {
    "constant": lambda table: Constant(table.number("value", unit="1")),
    "sine": lambda table: Sine(
        table.number("amplitude", unit="1"), table.number("offset", unit="1", default=0.0), _period(table)
    ),
    "square": lambda table: _span(Square, table),
    "ramp": lambda table: _span(Ramp, table),
    "points": _points,
    "count": lambda table: Count(table.integer("modulo", low=2, high=1 << 32)),
    "noise": lambda table: Noise(
        table.number("mean", unit="1", default=0.0),
        table.number("deviation", unit="1", low=0.0),
        table.integer("seed", low=0, high=1 << 31, default=1),
    ),
}
"""Kinds of generators in a values file."""
