"""Markers that tie a row of the ECU's signal table to its signals on the bus.

The table itself is `ecu.estimators.signals`: each field of its named tuples is one row, and its marker names the
message, the DBC signal and the unit. `ecu.inputs`, `ecu.outputs` and the log read the rows from here, so that
adding a signal takes one row.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, TypeVar, get_type_hints

Marker = TypeVar("Marker")


@dataclass(frozen=True, slots=True)
class Received:
    """An input: where it comes from, and when a value is plausible."""

    message: str  # of the DBC
    signal: str
    unit: str  # SI
    limit: str = ""  # field of InputRules: largest plausible magnitude; '': any
    step: str = ""  # field of InputRules: largest plausible change in a frame; '': any
    state: str = ""  # signal of the same message by which the sensor reports its own faults
    sensed: bool = True  # by a sensor with noise, so that it never stands still for long


@dataclass(frozen=True, slots=True)
class Usable:
    """A flag: 1 while all of these inputs can be relied on."""

    inputs: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Sent:
    """An estimate: where it goes, and which signal says whether it is valid."""

    message: str
    signal: str
    unit: str
    validity: str = ""  # entry of `ecu.validity.NEEDS`
    flag: str = ""  # signal of the same message that carries that validity
    deviation_of: str = ""  # entry of `ecu.validity.NEEDS` of the estimate whose standard deviation this is


def rows(table: type, marker: type[Marker]) -> Iterator[tuple[str, Marker]]:
    """The fields of a named tuple that carry a marker of this type, in their order, with it."""
    hints: dict[str, Any] = get_type_hints(table, include_extras=True)
    for name, hint in hints.items():
        for data in getattr(hint, "__metadata__", ()):
            if isinstance(data, marker):
                yield name, data
