"""Axes of plots: round ticks, readable tick labels, positions as a share of the axis."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, slots=True)
class Axis:
    """A linear axis between two values."""

    start: float
    end: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.start) and math.isfinite(self.end) and self.start < self.end):
            raise ValueError(f"an axis needs start < end, both finite; got {self.start} and {self.end}")

    def share(self, value: ArrayLike) -> NDArray[np.float64]:
        """Where `value` lies: 0 at the start, 1 at the end."""
        return np.asarray((np.asarray(value, float) - self.start) / (self.end - self.start))

    def percent(self, value: float) -> str:
        """The same for a style sheet."""
        return f"{100 * float(self.share(value)):.3f}%"

    def ticks(self, count: int) -> list[float]:
        """About `count` round numbers, of four wanted at least two, in steps of 1, 2 or 5 times a power of ten."""
        rough = (self.end - self.start) / count
        power = 10.0 ** math.floor(math.log10(rough))
        steps = [m * power for m in (1.0, 2.0, 5.0, 10.0)]
        # 1e-9: a rough step of exactly 2 or 5 must not be rounded up to the next one
        wide = next(i for i, step in enumerate(steps) if step >= rough * (1 - 1e-9))
        found = self._multiples(steps[wide])
        return found if len(found) > 1 or wide == 0 else self._multiples(steps[wide - 1])

    def _multiples(self, step: float) -> list[float]:
        """Those that lie on the axis."""
        first = math.ceil(self.start / step - 1e-9)
        last = math.floor(self.end / step + 1e-9)
        return [n * step for n in range(first, last + 1)]


def around(values: Iterable[NDArray[np.float64]], always: Sequence[float] = ()) -> Axis:
    """An axis with some room around all finite values and around those that have to be visible."""
    known = [np.asarray(v)[np.isfinite(v)] for v in values]
    every = np.concatenate([*known, np.asarray(always, float)])
    if every.size == 0:
        every = np.zeros(1)
    low, high = float(every.min()), float(every.max())
    # 6 % on either side, so that a curve does not touch the frame; a constant gets a tenth of its value
    room = 0.06 * (high - low) if high > low else 0.1 * max(abs(high), 1.0)
    return Axis(low - room, high + room)


def number(value: float) -> str:
    """A tick label: no trailing zeros, a real minus sign."""
    text = f"{value:.6g}"
    return (text if text != "-0" else "0").replace("-", "−")
