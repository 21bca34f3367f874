"""The table of everything that can be measured: estimates, their validity, limits, reasons, states and inputs.

The table is derived from the ECU's signal table and from the DBC: a signal that is added there can be measured.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from dbc import loader_database
from dbc.signal import Signal
from ecu.bus_signals import Received, rows
from ecu.codes import CODE_VALUES
from ecu.cycle import EcuCycle
from ecu.estimators.signals import Estimates, Inputs
from ecu.outputs import messages

BASE: Final = 0x0002_0000
"""Address of the first measurement."""
FLOAT, BYTE = "FLOAT32_IEEE", "UBYTE"
SIZES: Final[Mapping[str, int]] = {FLOAT: 4, BYTE: 1}

# Estimates that stay inside the ECU have no signal on the bus to take unit and meaning from.
_INSIDE: Final[Mapping[str, tuple[str, str]]] = {
    **{f"tyre_model_{n}": ("N", "Longitudinal force of the tyre model at the transient slip.") for n in range(1, 5)},
    "lift_off_wheel": ("1", "The wheel of the lift-off margin, 1 to 4."),
    "predicted_margin": ("1", "The smallest lift-off margin over the prediction's horizon."),
    "specific_force_z": ("m/s2", "Specific force at the machine's centre of gravity, upwards."),
    "slope_pitch": ("rad", "Pitch of the rear frame against the horizon, nose down positive, without the sensor's lean in accelerations."),
    "slope_roll": ("rad", "Roll of the rear frame against the horizon, left side up positive, without the sensor's lean in accelerations."),
    "permitted_rate": ("rad/s", "Articulation rate that leaves a margin."),
    "permitted_direction": ("1", "Side that the permitted rate is for: 1 left, -1 right, 0 none."),
    "permitted_speed": ("m/s", "Speed that leaves a margin."),
    "permitted_lever": ("rad/s", "Rate of lift arm or bucket that leaves a margin."),
    "permitted_motion": ("1", "Its motion: 0 arm up, 1 arm down, 2 bucket back, 3 bucket forward."),
    "load_gap": ("N", "Sum of the normal forces less mass times vertical specific force."),
    "load_contradiction": ("rad", "Tilt on the tyres by the balance of forces against the gyro."),
    "speed_doubt": ("m/s", "How far the speed may be wrong because wheels slide."),
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """One number that can be read on the bus."""

    name: str
    source: str  # which values it is among: "input" or "value"
    key: str  # its name there
    unit: str  # SI
    comment: str
    type: str  # FLOAT32_IEEE or UBYTE
    address: int
    choices: Mapping[int, str] = field(default_factory=dict)  # meaning of the numbers

    @property
    def size(self) -> int:
        """Bytes."""
        return SIZES[self.type]


class _Row(NamedTuple):
    """A measurement that has no address yet."""

    name: str
    source: str
    key: str
    unit: str
    comment: str
    choices: Mapping[int, str]

    @property
    def type(self) -> str:
        return BYTE if self.choices else FLOAT


@lru_cache(maxsize=1)
def measurements() -> tuple[Measurement, ...]:
    """All measurements in the order of their addresses: the floats, then the bytes."""
    # floats first: all of them are then aligned, and both kinds are packed in one go each
    found = sorted([*_values(), *_inputs()], key=lambda row: row.type != FLOAT)
    table, address = [], BASE
    for row in found:
        table.append(Measurement(address=address, type=row.type, **row._asdict()))
        address += SIZES[row.type]
    return tuple(table)


def _values() -> Iterator[_Row]:
    """What a cycle finds: the estimates in the order of their table, then what it sends beside them."""
    database = loader_database()
    signals: dict[str, tuple[str, Signal]] = {}
    for message, content in messages().items():
        if message not in CODE_VALUES:  # trouble codes have their own messages
            for name, (unit, key) in content.items():
                signals.setdefault(key, (unit, database.by_name[message].by_signal[name]))
    for name in Estimates._fields:
        if name in signals:
            unit, signal = signals.pop(name)
            yield _Row(f"estimate.{name}", "value", name, unit, signal.comment, signal.choices)
        else:
            yield _Row(f"estimate.{name}", "value", name, *_INSIDE[name], {})
    for key, (unit, signal) in signals.items():
        choices = signal.choices or ({0: "no", 1: "yes"} if signal.length == 1 else {})
        yield _Row(_name(key), "value", key, unit, signal.comment, choices)


def _name(key: str) -> str:
    """The name of A2L for a value of the cycle: letters, digits, _ and dots between parts."""
    first, _, rest = key.partition(" ")
    if rest == "valid":
        return f"valid.{first}"
    if first in ("limit", "reason"):
        return f"{first}.{rest.replace(' ', '_')}"
    return key.replace(" ", "_").replace("-", "_")


def _inputs() -> Iterator[_Row]:
    database = loader_database()
    for name, row in rows(Inputs, Received):
        signal = database.by_name[row.message].by_signal[row.signal]
        yield _Row(f"input.{name}", "input", name, row.unit, signal.comment, signal.choices)


class MeasuredImage:
    """The measurements of one ECU as bytes of memory, all of the same cycle."""

    def __init__(self, cycle: EcuCycle) -> None:
        self._cycle = cycle
        table = measurements()
        self._floats = [(row.source == "input", row.key) for row in table if row.type == FLOAT]
        self._bytes = [row.key for row in table if row.type == BYTE]
        self.size = sum(row.size for row in table)
        self._of: Mapping[str, float] | None = None  # the cycle's values that `_packed` was made of
        self._packed = bytes(self.size)

    def bytes(self) -> bytes:
        """The image of the last cycle; zeros before the first."""
        values, inputs = self._cycle.values, self._cycle.inputs
        # made once for each cycle, however many lists and commands read it
        if values is not self._of and values:
            self._of = values
            floats = [inputs[key] if of_input else values[key] for of_input, key in self._floats]
            with np.errstate(over="ignore"):  # beyond single precision is infinity
                packed = np.array(floats).astype("<f4").tobytes()
            self._packed = packed + bytes(_byte(values[key]) for key in self._bytes)
        return self._packed


def _byte(value: float) -> int:
    """The number of a value table; 255 for what is none."""
    return int(value) if math.isfinite(value) and 0 <= value <= 255 else 255
