"""What was recorded: named channels with units, each with its own stamps, evenly spaced or not.

Damage is cleaned where that loses nothing but the damage, and told as complaints; a fatal complaint ends in
the verdict 'inconclusive', never in an exception from the middle of the algebra.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


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
    """Something wrong with a recording; `fatal` when nothing can be concluded from it."""

    recording: str
    signal: str
    text: str
    fatal: bool = False


def signal(time_s: ArrayLike, value: ArrayLike, unit: str, *, held: bool = False) -> Signal:
    """Make a Signal from anything array-like."""
    return Signal(np.asarray(time_s, float), np.asarray(value, float), unit, held)


def changes_only(time_s: ArrayLike, value: ArrayLike, unit: str) -> Signal:
    """Undo a zero-order hold: keep the sample at which each new value first appears.

    A slow sensor logged in fast rows repeats its value; taken as they are, the repeats look like a delay of half
    the sensor's period and like noise that is not white. Identical consecutive readings are lost with them.
    """
    t, y = np.asarray(time_s, float), np.asarray(value, float)
    new = np.concatenate(([False], np.diff(y) != 0.0))
    return Signal(t[new], y[new], unit)


def cleaned(recording: Recording) -> tuple[Recording, list[Complaint]]:
    """Drop samples that are not numbers and stamps that do not advance; say how many."""
    kept: dict[str, Signal] = {}
    complaints: list[Complaint] = []
    for name, raw in recording.signals.items():
        good = np.isfinite(raw.time_s) & np.isfinite(raw.value)
        if lost := int(np.size(good) - np.count_nonzero(good)):
            text = f"{lost} of {good.size} samples are not numbers; dropped"
            complaints.append(Complaint(recording.name, name, text, fatal=False))
        t, y = raw.time_s[good], raw.value[good]
        forward = t > np.maximum.accumulate(np.concatenate(([-np.inf], t[:-1]))) if t.size else good[:0]
        if back := int(t.size - np.count_nonzero(forward)):
            text = f"{back} of {t.size} stamps do not advance (repeated or wrongly ordered rows); dropped"
            complaints.append(Complaint(recording.name, name, text, fatal=False))
        kept[name] = Signal(t[forward], y[forward], raw.unit, raw.held)
    return Recording(recording.name, kept, recording.constants), complaints
