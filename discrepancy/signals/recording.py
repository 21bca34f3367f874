"""Recordings: named channels with units, each with its own time stamps, evenly spaced or not; and complaints about them.

Damaged samples are removed, and every removal becomes a complaint. A fatal complaint leads to the verdict 'inconclusive', never to an
exception from within the computation.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# Share of stamps that go backwards. Above it the rows are unordered and are sorted; below it a clock was set back, and sorting would mix
# two times.
UNORDERED = 0.1


@dataclass(frozen=True, slots=True)
class Signal:
    """One channel. Raises ValueError unless there is one stamp per value."""

    time_s: Array  # stamps (n,)
    value: Array  # (n,)
    unit: str
    held: bool = False  # a value holds until the next one (commands, gear), else see signals.resampling

    def __post_init__(self) -> None:
        if self.time_s.shape != self.value.shape or self.time_s.ndim != 1:
            raise ValueError(
                f"a signal needs one stamp per value: {self.time_s.shape} stamps and {self.value.shape} values"
            )


@dataclass(frozen=True, slots=True)
class Recording:
    """One run."""

    name: str
    signals: Mapping[str, Signal]
    # numbers that are valid for the whole run (mass on that day, diameter of the ball), SI
    constants: Mapping[str, float] = field(default_factory=dict)


def longest(recordings: Iterable[Recording]) -> float:
    """Time from the first to the last sample of the longest recording [s]; 0 without samples. Stamps may be in no order, or no numbers."""
    stamps = [np.concatenate([s.time_s for s in r.signals.values()] or [np.zeros(0)]) for r in recordings]
    good = [s[np.isfinite(s)] for s in stamps]
    return max((float(np.ptp(s)) for s in good if s.size), default=0.0)


@dataclass(frozen=True, slots=True)
class Complaint:
    """An error of a recording."""

    recording: str
    signal: str  # "" for the whole recording
    text: str  # the error and its remedy, as the predicate of a sentence
    fatal: bool = False  # nothing can be concluded from the recording, or from the signal

    @property
    def described(self) -> str:
        """'drive.csv: speed is constant at 2 m/s'."""
        return f"{self.recording}: {f'{self.signal} {self.text}'.strip()}"


def signal(time_s: ArrayLike, value: ArrayLike, unit: str, *, held: bool = False) -> Signal:
    """Make a Signal from anything array-like."""
    return Signal(np.asarray(time_s, float), np.asarray(value, float), unit, held)


def changes_only(time_s: ArrayLike, value: ArrayLike, unit: str) -> Signal:
    """A signal without its zero-order hold: one sample per new value, stamped at the middle of the time for which it was held."""
    # A slow sensor logged in fast rows repeats its value. The repeats are no information, and their staircase is not white noise. Holding
    # for T delays a signal by T/2 on average; the stamps in the middle keep that delay, as a reader of the rows sees it.
    t, y = np.asarray(time_s, float), np.asarray(value, float)
    first = np.flatnonzero(np.diff(y) != 0.0) + 1
    if first.size < 2:
        return Signal(t[:0], y[:0], unit)
    until = np.append(t[first[1:]], t[first[-1]] + np.median(np.diff(t[first])))
    return Signal(0.5 * (t[first] + until), y[first], unit)


def cleaned(recording: Recording) -> tuple[Recording, list[Complaint]]:
    """The recording without samples that are not numbers and stamps that do not advance, unordered rows sorted; and complaints about it."""
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
            text = f"{backwards} of {t.size} stamps go backwards: the rows are not ordered by time; sorted"
            complaints.append(Complaint(recording.name, name, text, fatal=False))
        forward = t > np.maximum.accumulate(np.concatenate(([-np.inf], t[:-1]))) if t.size else good[:0]
        if back := int(t.size - np.count_nonzero(forward)):
            text = f"{back} of {t.size} stamps do not advance (repeated or wrongly ordered rows); dropped"
            complaints.append(Complaint(recording.name, name, text, fatal=False))
        kept[name] = Signal(t[forward], y[forward], raw.unit, raw.held)
    return Recording(recording.name, kept, recording.constants), complaints
