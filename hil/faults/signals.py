"""Faults of signal values: frozen, offset, with spikes or swapped, in frames that are otherwise valid.

The fault is that of a sensor, ahead of the end-to-end protection: counters continue and the CRC is valid.
"""

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from bus.frame import Frame
from configuration import CheckedTable
from dbc.database import MessageCodec
from dbc.signal import Signal
from hil.faults.passage import Effect, Planned, Selection, Side
from hil.faults.rawbits import RawSignal, signed_again


@dataclass(frozen=True, slots=True)
class Freeze:
    """A signal keeps the bits it had in the first frame of the fault; value: or this one, in its DBC unit."""

    signal: str
    value: float | None = None

    def effect(self, generator: random.Random) -> Effect:
        held: dict[int, int] = {}

        def freeze(codec: MessageCodec, data: bytes) -> bytes:
            raw = RawSignal(codec, self.signal)
            if self.value is None:
                # the first frame of the fault decides; frames of several messages are held separately
                return raw.write(data, held.setdefault(codec.can_id, raw.read(data)))
            # Saturated to the signal's bits, not to its range: a stuck sensor may say what it must not.
            lowest, highest = raw.signal.raw_limits
            number = round((self.value - raw.signal.offset) / raw.signal.scale)
            return raw.write(data, min(max(number, lowest), highest))

        return _Rewriting(freeze)


@dataclass(frozen=True, slots=True)
class Offset:
    """A signal is shifted and saturates at its DBC range. "Not available" stays as it is."""

    signal: str
    value: float  # in the signal's DBC unit
    every: int = 1  # one frame in so many, the first included; 1 shifts them all, more makes spikes

    def effect(self, generator: random.Random) -> Effect:
        seen: dict[int, int] = {}

        def shift(codec: MessageCodec, data: bytes) -> bytes:
            count = seen.get(codec.can_id, 0)
            seen[codec.can_id] = count + 1
            if count % self.every:
                return data
            raw = RawSignal(codec, self.signal)
            number = raw.to_number(raw.read(data))
            return raw.write(data, shifted(raw.signal, number, self.value))

        return _Rewriting(shift)


def shifted(signal: Signal, number: int, value: float) -> int:
    """The raw integer moved by a physical value, within the signal's range; one outside it stays."""
    lowest, highest = signal.raw_range
    # codes outside the range mean "not available" or "error": a broken sensor line still reports them
    if not lowest <= number <= highest:
        return number
    return min(max(number + round(value / signal.scale), lowest), highest)


@dataclass(frozen=True, slots=True)
class Swap:
    """Two signals of a message exchange their bits: sensors plugged into each other's sockets."""

    one: str
    other: str

    def effect(self, generator: random.Random) -> Effect:
        def swap(codec: MessageCodec, data: bytes) -> bytes:
            one, other = RawSignal(codec, self.one), RawSignal(codec, self.other)
            return other.write(one.write(data, other.read(data)), one.read(data))

        return _Rewriting(swap)


class _Rewriting(Effect):
    """Frames with changed content and a valid CRC; too short ones pass unchanged."""

    def __init__(self, rewrite: Callable[[MessageCodec, bytes], bytes]) -> None:
        self._rewrite = rewrite

    def passed(self, planned: Planned, side: Side, codec: MessageCodec | None) -> Sequence[Planned]:
        at_ns, frame = planned
        if codec is None or len(frame.data) != codec.length:
            return (planned,)
        data = self._rewrite(codec, frame.data)
        # unchanged frames are passed as the same object, which is how the injector counts affected ones
        if data == frame.data:
            return (planned,)
        return (Planned(at_ns, Frame(frame.can_id, signed_again(codec, data), frame.at_ns, frame.flags)),)


def read_freeze(table: CheckedTable, selection: Selection) -> Freeze:
    """kind = "freeze"."""
    name = table.text("signal")
    _signals(table, "signal", name, selection)
    return Freeze(name, _level(table, name, selection) if "value" in table else None)


def _level(table: CheckedTable, name: str, selection: Selection) -> float:
    """A value that the bits of the signal can hold."""
    ends = [
        raw * signal.scale + signal.offset
        for signal in _signals(table, "signal", name, selection)
        for raw in signal.raw_limits
    ]
    unit = _signals(table, "signal", name, selection)[0].unit or "1"
    return table.number("value", unit=unit, low=min(ends), high=max(ends))


def read_offset(table: CheckedTable, selection: Selection) -> Offset:
    """kind = "offset"."""
    name = table.text("signal")
    return Offset(name, _value(table, "offset", name, selection))


def read_spike(table: CheckedTable, selection: Selection) -> Offset:
    """kind = "spike"."""
    name = table.text("signal")
    value = _value(table, "height", name, selection)
    return Offset(name, value, every=table.integer("every", low=2, high=1_000_000, default=50))


def read_swap(table: CheckedTable, selection: Selection) -> Swap:
    """kind = "swap"."""
    names = table.texts("signals", count=2)
    ones = _signals(table, "signals", names[0], selection)
    others = _signals(table, "signals", names[1], selection)
    for one, other in zip(ones, others, strict=True):
        # raw bits are exchanged, so both must be coded alike; otherwise the values would change as well
        if (one.length, one.signed, one.scale, one.offset) != (
            other.length,
            other.signed,
            other.scale,
            other.offset,
        ):
            raise table.error(
                "signals", f"= {list(names)}: {one.name} and {other.name} are coded differently"
            )
    return Swap(*names)


def _signals(table: CheckedTable, key: str, name: str, selection: Selection) -> list[Signal]:
    """The signal `name` of every selected message."""
    if not selection.codecs:
        raise table.error("message", "is missing: a signal belongs to a message")
    for codec in selection.codecs:
        if name not in codec.by_signal:
            raise table.error(
                key, f"= {name!r} is no signal of {codec.name}; it has {', '.join(codec.signals)}"
            )
        if codec.is_multiplexed:
            raise table.error(
                key, f"= {name!r}: {codec.name} is multiplexed, its signals are not in every frame"
            )
    return [codec.by_signal[name] for codec in selection.codecs]


def _value(table: CheckedTable, key: str, name: str, selection: Selection) -> float:
    """A physical value in the DBC unit of the signal; `unit` may say which, and then has to be that one."""
    signals = _signals(table, "signal", name, selection)
    unit = signals[0].unit or "1"
    for signal in signals:
        if signal.is_float:
            raise table.error(
                "signal", f"= {name!r} is a floating-point signal; only integer ones can be shifted"
            )
        if "unit" in table and table.text("unit") != (signal.unit or "1"):
            raise table.error("unit", f"= {table.text('unit')!r} is not the unit of {name}, {unit!r}")
    span = max(_span(signal) for signal in signals)
    return table.number(key, unit=unit, low=-span, high=span)


def _span(signal: Signal) -> float:
    """The width of the signal's range."""
    lowest, highest = signal.raw_range
    return math.fabs((highest - lowest) * signal.scale)
