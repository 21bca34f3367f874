"""Finds signals of a run by name, for expectations and conditions: `Message.Signal` on the bus, `truth.FIELD` in the plant."""

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from bus.user_error import UserError
from dbc.database import Database
from dbc.signal import Signal
from plant.truth import Truth

if TYPE_CHECKING:  # it brings a compiler, which a live bus does not need
    from dbc.columns import Columns

TRUTH: Final = "truth"
WHEELS: Final = ("front_left", "front_right", "rear_left", "rear_right")
AXES: Final = ("x", "y", "z")
SIDES: Final = ("left", "right")
_PARTS: Final = {2: SIDES, 3: AXES, 4: WHEELS}


class SignalError(UserError, ValueError):
    """A signal or condition does not exist; the message lists what does."""


class Source(Protocol):
    """The origin of the values: a finished run, or one that is still running."""

    @property
    def messages(self) -> "Mapping[str, Columns]":
        """Decoded frames by message name."""

    @property
    def truth(self) -> Mapping[str, NDArray[np.float64]]:
        """Columns of the plant's truth."""


@dataclass(frozen=True, slots=True)
class Series:
    """A signal over time."""

    time_s: NDArray[np.float64]  # (n,) stamps [s] on the clock of the run
    values: NDArray[np.float64]  # (n,) in the signal's unit; NaN: not available

    def between(self, from_s: float, to_s: float) -> "Series":
        """The samples from `from_s` to `to_s`, both included."""
        inside = (self.time_s >= from_s) & (self.time_s <= to_s)
        return Series(self.time_s[inside], self.values[inside])


@dataclass(frozen=True, slots=True)
class BusSignal:
    """A signal of a message, in the DBC's unit."""

    message: str
    signal: Signal

    @property
    def name(self) -> str:
        """As it is written."""
        return f"{self.message}.{self.signal.name}"

    @property
    def unit(self) -> str:
        """Of its values."""
        return self.signal.unit

    @property
    def labels(self) -> Mapping[str, int]:
        """Values by the names of the DBC's value table."""
        return {name: value for value, name in self.signal.choices.items()}

    @property
    def absent(self) -> float | None:
        """The value that its value table calls not available; None if it has none."""
        return self.signal.not_available if self.signal.choices else None

    def series(self, source: Source) -> Series | None:
        """Its values; None if no frame carried it."""
        columns = source.messages.get(self.message)
        if columns is None or not columns.time_s.size:
            return None
        values = np.asarray(columns.signals[self.signal.name], float)
        missing = self.signal.not_available
        # a signal with a value table keeps its `not_available` as a number: conditions may name it
        if missing is not None and not self.signal.choices:
            absent = missing * self.signal.scale + self.signal.offset
            # compared with half a step of the raw value: the decoded float need not equal the product exactly
            values = np.where(
                np.isclose(values, absent, rtol=0.0, atol=abs(self.signal.scale) / 2), np.nan, values
            )
        return Series(columns.time_s, values)

    def shown(self, value: float) -> str:
        """A value as text: its name in the value table, or the number with its unit."""
        if value != value:
            return "not available"
        # a mean or a minimum of states may lie between two of them and has no name
        label = self.signal.choices.get(round(value)) if float(value).is_integer() else None
        return label if label is not None else f"{value:g} {self.unit}".rstrip()


@dataclass(frozen=True, slots=True)
class TrueSignal:
    """A field of the plant's truth, SI."""

    field: str
    part: int | None  # index into a vector; None: the field is a scalar

    @property
    def name(self) -> str:
        """As it is written."""
        if self.part is None:
            return f"{TRUTH}.{self.field}"
        return f"{TRUTH}.{self.field}.{_PARTS[Truth.fields[self.field].size][self.part]}"

    unit: str = ""

    @property
    def labels(self) -> Mapping[str, int]:
        """None: the truth has numbers only."""
        return {}

    @property
    def absent(self) -> float | None:
        """None: the truth is always available."""
        return None

    def series(self, source: Source) -> Series | None:
        """Its values; None if the run has no truth."""
        if self.field not in source.truth or not source.truth["time_s"].size:
            return None
        column = np.asarray(source.truth[self.field], float)
        values = column if self.part is None else column[:, self.part]
        return Series(np.asarray(source.truth["time_s"], float), values)

    def shown(self, value: float) -> str:
        """The number; the truth is in SI."""
        return f"{value:g}"


AnySignal = BusSignal | TrueSignal


def find_signal(name: str, database: Database) -> AnySignal:
    """The signal of that name; SignalError names what there is instead."""
    first, _, rest = name.partition(".")
    if not rest:
        raise SignalError(f"{name!r} is no signal: write Message.Signal, or truth.FIELD")
    if first == TRUTH:
        return _of_truth(name, rest)
    codec = database.by_name.get(first)
    if codec is None:
        raise SignalError(
            f"{name!r}: {database.source} has no message {first!r}{_near(first, database.by_name)}"
        )
    signal = codec.by_signal.get(rest)
    if signal is None:
        raise SignalError(f"{name!r}: {first} has no signal {rest!r}{_near(rest, codec.by_signal)}")
    return BusSignal(first, signal)


def _of_truth(name: str, rest: str) -> TrueSignal:
    field, _, part = rest.partition(".")
    if field not in Truth.fields:
        raise SignalError(f"{name!r}: the truth has no {field!r}{_near(field, Truth.fields)}")
    size = Truth.fields[field].size
    if size == 1:
        if part:
            raise SignalError(f"{name!r}: {field} is one number; leave {part!r} out")
        return TrueSignal(field, None)
    parts = _PARTS.get(size, ())
    if part not in parts:
        raise SignalError(
            f"{name!r}: {field} has several numbers; write {field}.{' or .'.join(parts) or '?'}"
        )
    return TrueSignal(field, parts.index(part))


def _near(name: str, known: Mapping[str, object]) -> str:
    # one suggestion: a list of all signals hides the one with the typing error
    near = difflib.get_close_matches(name, known, n=1)
    return f"; did you mean {near[0]!r}?" if near else f"; it has {', '.join(known)}"
