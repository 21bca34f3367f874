"""Tables in C of everything around the estimators: inputs, frames, validity, reasons, states, rules of one calibration.

The runtime (`deploy/c/runtime`) is the same for every machine and reads these. They come from the Python tables: the signal
table, the DBC, `ecu.validity`, `ecu.reasons`, `ecu.states`, and the calibration.
"""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from bus.user_error import UserError
from dbc.binding import Binding
from dbc.database import Database, MessageCodec
from dbc.packing import Signals
from dbc.protection import COUNTERS
from dbc.schedule import due_messages, phases
from dbc.signal import Signal
from ecu.calibration import Calibration
from ecu.inputs import Source, sources
from ecu.outputs import TICK_NS, messages

WIDEST: Final = 24
"""Bits of a raw value that single precision carries."""


class NotExportableError(UserError, ValueError):
    """A message that the C runtime does not know how to handle; the message says which and why."""


@dataclass(frozen=True, slots=True)
class Received:
    """One input of the ECU, with its place among all inputs."""

    name: str
    source: Source
    at: int  # of the field within its source


def inputs_of(calibration: Calibration) -> list[Received]:
    """All inputs in the order of their messages: the numbering of the C runtime."""
    return [
        Received(field.name, source, at)
        for source in sources(calibration.inputs)
        for at, field in enumerate(source.fields)
    ]


def constant(prefix: str, name: str) -> str:
    """An enumerator's name: words of camel case and spaces apart."""
    # camel case would be unreadable in capitals: WheelSpeeds -> WHEEL_SPEEDS
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name)
    return f"{prefix}_{re.sub(r'[^A-Za-z0-9]+', '_', words)}".upper()


def real(number: float) -> str:
    """A constant of the runtime's number type."""
    if math.isinf(number):
        return "REAL_INFINITY" if number > 0 else "-REAL_INFINITY"
    return f"R({float(number)!r})"


def enumeration(title: str, names: Iterable[str], count: str) -> str:
    """Numbered macros, and one with their number. Not an enum, whose signed members would count the bits of a shift."""
    return f"/* {title} */\n" + "".join(numbered(name, k) for k, name in enumerate([*names, count]))


def numbered(name: str, number: int) -> str:
    """An unsigned constant."""
    return f"#define {name} {number}U\n"


def rows(kind: str, name: str, items: Sequence[str], count: str) -> str:
    """A constant array; a row each."""
    body = "".join(f"    {item},\n" for item in items)
    return f"const {kind} {name}[{count}] = {{\n{body}}};\n"


def byte_list(content: Sequence[int]) -> str:
    """Bytes as an initialiser."""
    return "{" + ", ".join(f"{byte:#04x}U" for byte in content) + "}"


# -- what comes from the bus


def place(codec: MessageCodec, signal: Signal) -> str:
    """Bits of a signal as initialisers: first bit, number, signed."""
    if signal.big_endian or signal.is_float or signal.length > WIDEST or codec.length > 8:
        raise NotExportableError(
            f"{codec.name}.{signal.name}: the C runtime handles little-endian integers of at most {WIDEST} bits in 8 bytes"
        )
    return f".first_bit = {signal.first_bit}U, .bits = {signal.length}U, .is_signed = {_truth(signal.signed)}"


def protection(codec: MessageCodec) -> str:
    """Data id of the protection; -1 without one."""
    if codec.protection is None:
        return "-1"
    if codec.profile is None or codec.profile.mode != "both":
        raise NotExportableError(
            f"{codec.name}: only E2E profile 1 with both bytes of the data id can be exported"
        )
    return str(codec.profile.data_id)


def received_tables(calibration: Calibration, database: Database) -> str:
    """Inputs and the messages that they come in."""
    fields, listeners, states, first, first_state = [], [], [], 0, 0
    rules = calibration.inputs
    for source in sources(rules):
        codec = database.by_name[source.message]
        binding = Binding(codec, {field.row.signal: field.row.unit for field in source.fields})
        names = [field.name for field in source.fields]
        for field, factor in zip(source.fields, binding.factors, strict=True):
            fields.append(_input_row(codec, field, factor))
        for signal, vouched in source.states.items():
            mask = sum(1 << (first + names.index(name)) for name in vouched)
            states.append(f"{{{place(codec, codec.by_signal[signal])}, .inputs = {mask}ULL}}")
        listeners.append(
            f"{{.id = {codec.can_id:#x}U, .length = {codec.length}U, .data_id = {protection(codec)}, .cycle_ns = {codec.cycle_ns}LL,"
            f" .fresh_ns = {math.floor(rules.stale_cycles * codec.cycle_ns)}LL, .group = {int(source.group)}U,"
            f" .first = {first}U, .last = {first + len(names)}U, .first_state = {first_state}U,"
            f" .last_state = {first_state + len(source.states)}U}} /* {source.message} */"
        )
        first, first_state = first + len(names), first_state + len(source.states)
    return "\n".join(
        [
            rows("InputField", "input_fields", fields, "INPUTS"),
            rows("Listener", "listeners", listeners, "LISTENERS"),
            rows("SensorState", "sensor_states", states, "SENSOR_STATES"),
        ]
    )


def _input_row(codec: MessageCodec, field: Any, factor: float) -> str:
    signal = codec.by_signal[field.row.signal]
    # a value table may name raw values outside of the range of numbers: they are states, not errors
    lowest, highest = signal.raw_range if not signal.choices else signal.raw_limits
    return (
        f"{{{place(codec, signal)}, .scale = {real(signal.scale)}, .offset = {real(signal.offset)}, .factor = {real(factor)},"
        f" .lowest = {lowest}, .highest = {highest}, .limit = {real(field.limit)}, .step = {real(field.step)},"
        f" .sensed = {_truth(field.row.sensed)}}} /* {field.name} */"
    )


# -- what goes onto the bus


def sent_order(outgoing: Iterable[str], database: Database) -> list[MessageCodec]:
    """The ECU's messages in the order of the Python ECU's schedule, so that both put the same frames into the same tick."""
    return sorted((database.by_name[name] for name in outgoing), key=lambda codec: codec.cycle_ns)


def sent_tables(
    outgoing: Mapping[str, Signals], values: Mapping[str, str], database: Database
) -> tuple[str, int]:
    """Signals and messages of the ECU, and the most frames of a tick. values: name of a value -> its enumerator."""
    codecs = sent_order(outgoing, database)
    cycles = [codec.cycle_ns // TICK_NS for codec in codecs]
    starts = phases(cycles)
    signals: list[str] = []
    frames: list[str] = []
    for codec, every, phase in zip(codecs, cycles, starts, strict=True):
        chosen = outgoing[codec.name]
        binding = Binding(codec, {name: unit for name, (unit, _) in chosen.items()})
        first = len(signals)
        for (name, (_, source)), factor in zip(chosen.items(), binding.factors, strict=True):
            signals.append(_output_row(codec, codec.by_signal[name], factor, values[source]))
        # the bits that no value writes: unused ones and those of signals that this ECU does not fill
        resting = int.from_bytes(binding.encode([0.0] * len(chosen)), "little")
        for name in chosen:
            signal = codec.by_signal[name]
            resting &= ~(((1 << signal.length) - 1) << signal.first_bit)
        frames.append(
            f"{{.id = {codec.can_id:#x}U, .length = {codec.length}U, .data_id = {protection(codec)}, .resting = {resting:#x}ULL,"
            f" .first = {first}U, .last = {len(signals)}U, .every = {every}U, .phase = {phase}U}} /* {codec.name} */"
        )
    most = max(len(due) for due in due_messages(cycles, starts))
    text = rows("OutputSignal", "output_signals", signals, "OUTPUT_SIGNALS") + "\n"
    return text + rows("OutputFrame", "output_frames", frames, "OUTPUT_FRAMES"), most


def _output_row(codec: MessageCodec, signal: Signal, factor: float, value: str) -> str:
    lowest, highest = signal.raw_range
    absent = -1 if signal.not_available is None else signal.not_available
    return (
        f"{{{place(codec, signal)}, .scale = {real(signal.scale)}, .offset = {real(signal.offset)}, .factor = {real(factor)},"
        f" .lowest = {lowest}, .highest = {highest}, .absent = {absent}, .value = {value}}} /* {codec.name}.{signal.name} */"
    )


def _truth(flag: bool) -> str:
    return "true" if flag else "false"


def counters() -> str:
    """The constants of the protection."""
    return numbered("COUNTERS", COUNTERS)


def all_values() -> list[str]:
    """Names of all values that go into frames, as the messages first name them."""
    return list(dict.fromkeys(source for signals in messages().values() for _, source in signals.values()))
