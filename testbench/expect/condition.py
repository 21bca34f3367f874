"""Conditions on one signal, such as `RollOver.State >= warning`, one grammar for all their users."""

import operator
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from dbc.database import Database
from testbench.expect.signals import AnySignal, Series, SignalError, Source, find_signal

_OPERATORS: Final[dict[str, Callable[[Any, float], Any]]] = {
    "==": operator.eq,
    "!=": operator.ne,
    ">=": operator.ge,
    "<=": operator.le,
    ">": operator.gt,
    "<": operator.lt,
}
_FORM: Final = re.compile(r"^\s*([\w.]+)\s*(==|!=|>=|<=|>|<)\s*(\S+)\s*(\S*)\s*$")


@dataclass(frozen=True, slots=True)
class Condition:
    """A signal compared with a value. A sample that is not available never fulfils it."""

    text: str  # as written, for reports
    signal: AnySignal
    operator: str
    value: float  # in the signal's unit

    @classmethod
    def parse(cls, text: str, database: Database) -> Self:
        """`SIGNAL OPERATOR VALUE [UNIT]`; VALUE is a number or a name of the value table. SignalError says what is wrong."""
        found = _FORM.match(text)
        if found is None:
            raise SignalError(
                f"{text!r} is no condition: write SIGNAL OPERATOR VALUE, such as RollOver.State >= warning, "
                f"with one of {' '.join(_OPERATORS)}"
            )
        name, sign, written, unit = found.groups()
        signal = find_signal(name, database)
        if unit and unit != signal.unit:
            raise SignalError(f"{text!r}: {name} is in {signal.unit or 'SI without a unit'}, not in {unit}")
        return cls(" ".join(text.split()), signal, sign, value_of(written, signal))

    def holds(self, values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Where it holds, shape of `values`; NaN never fulfils a condition, not even !=."""
        # numpy's != is true for NaN
        known = ~np.isnan(values)
        # A value table's `not_available` is often its largest number, but no state beyond *warning*: it must not
        # fulfil >=. Only == and != may name it.
        if self.operator not in ("==", "!=") and (absent := self.signal.absent) is not None:
            known &= values != absent
        return known & np.asarray(_OPERATORS[self.operator](values, self.value), bool)

    def series(self, source: Source) -> Series | None:
        """The values it looks at."""
        return self.signal.series(source)

    def __str__(self) -> str:
        return self.text


def value_of(written: str | float, signal: AnySignal) -> float:
    """The number that a text means for a signal: itself, or a name of its value table."""
    labels = signal.labels
    if isinstance(written, str) and written in labels:
        return float(labels[written])
    try:
        value = float(written)
    except ValueError:
        names = f"; its values are {', '.join(labels)}" if labels else ""
        raise SignalError(f"{written!r} is no value of {signal.name}{names}") from None
    if value != value:
        raise SignalError(f"{signal.name}: NaN cannot be compared")
    return value
