"""What was recorded: named channels with units, each with its own stamps, evenly spaced or not.

Damage is cleaned where that loses nothing but the damage, and every cleaning becomes a complaint; a fatal complaint ends in
the verdict 'inconclusive', never in an exception from the middle of the algebra.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

UNORDERED = (
    0.1  # share of stamps that go backwards, from which rows are in no order; below it a clock was set back
)


@dataclass(frozen=True, slots=True)
class Signal:
    """One channel: stamps [s], values in `unit`. `held` values stand until the next one (commands, gear)."""

    time_s: Array
    value: Array
    unit: str
    held: bool = False

    def __post_init__(self) -> None:
        if self.time_s.shape != self.value.shape or self.time_s.ndim != 1:
            raise ValueError(
                f"a signal needs one stamp per value: {self.time_s.shape} stamps and {self.value.shape} values"
            )


@dataclass(frozen=True, slots=True)
class Recording:
    """Signals of one run, and the constants that hold in it (mass on the day, diameter of the ball), SI."""

    name: str
    signals: Mapping[str, Signal]
    constants: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Complaint:
    """Something wrong with a recording; `fatal` when nothing can be concluded from it, or from the signal named."""

    recording: str
    signal: str
    text: str
    fatal: bool = False

    @property
    def described(self) -> str:
        """'drive.csv: speed is constant at 2 m/s'."""
        return f"{self.recording}: {f'{self.signal} {self.text}'.strip()}"


def signal(time_s: ArrayLike, value: ArrayLike, unit: str, *, held: bool = False) -> Signal:
    """Make a Signal from anything array-like."""
    return Signal(np.asarray(time_s, float), np.asarray(value, float), unit, held)


def changes_only(time_s: ArrayLike, value: ArrayLike, unit: str) -> Signal:
    """Undo a zero-order hold: one sample per new value, stamped at the middle of the time it stood.

    A slow sensor logged in fast rows repeats its value; the repeats are no information and their staircase is no white
    noise. A hold of T is a mean delay of T/2 to whoever reads the rows, and the stamps keep it.
    """
    t, y = np.asarray(time_s, float), np.asarray(value, float)
    first = np.flatnonzero(np.diff(y) != 0.0) + 1
    if first.size < 2:
        return Signal(t[:0], y[:0], unit)
    until = np.append(t[first[1:]], t[first[-1]] + np.median(np.diff(t[first])))
    return Signal(0.5 * (t[first] + until), y[first], unit)


def cleaned(recording: Recording) -> tuple[Recording, list[Complaint]]:
    """Drop samples that are not numbers and stamps that do not advance, and sort what is in no order; say how many."""
    kept: dict[str, Signal] = {}
    complaints: list[Complaint] = []
    for name, raw in recording.signals.items():
        good = np.isfinite(raw.time_s) & np.isfinite(raw.value)
        if lost := int(np.size(good) - np.count_nonzero(good)):
            text = f"{lost} of {good.size} samples are not numbers; dropped"
            complaints.append(Complaint(recording.name, name, text, fatal=False))
        t, y = raw.time_s[good], raw.value[good]
        backwards = int(np.count_nonzero(np.diff(t) < 0.0))
        if backwards > UNORDERED * t.size:
            order = np.argsort(t, kind="stable")
            t, y = t[order], y[order]
            text = f"{backwards} of {t.size} stamps go backwards: rows in another order than that of time; sorted"
            complaints.append(Complaint(recording.name, name, text, fatal=False))
        forward = t > np.maximum.accumulate(np.concatenate(([-np.inf], t[:-1]))) if t.size else good[:0]
        if back := int(t.size - np.count_nonzero(forward)):
            text = f"{back} of {t.size} stamps do not advance (repeated or wrongly ordered rows); dropped"
            complaints.append(Complaint(recording.name, name, text, fatal=False))
        kept[name] = Signal(t[forward], y[forward], raw.unit, raw.held)
    return Recording(recording.name, kept, recording.constants), complaints
