"""Chosen signals of one message in SI units: the only part of the DBC that plant and ECU use.

Units are compared once, at construction; the conversion is part of the generated function.
What the bits can hold but the DBC's range cannot is where "not available" and "error" lie:
it reads as NaN, and NaN is sent as "not available" (J1939 reserves the top codes for this).
"""

from collections.abc import Callable, Mapping, Sequence

from dbc import codegen
from dbc.database import MessageCodec
from dbc.signal import Signal
from dbc.units import factor_to

_PROTECTION = ("Crc", "AliveCounter")


class Binding:
    """Reads and writes `signals` (name -> SI unit) of a message, in the order given.

    decode(data): SI values, NaN where a signal lies outside its DBC range; signals with a value
        table are numbers of that table, never NaN.
    encode(values): frame bytes. Values are saturated to the DBC's range; NaN becomes "not
        available" (EncodeError if the signal has no such code). Other signals are "not
        available" where they can say so and else raw 0; CRC and counter are left 0.
    factors: SI value per value in the DBC's unit, in the order of `signals`.
    """

    decode: Callable[[bytes], tuple[float, ...]]
    encode: Callable[[Sequence[float]], bytes]

    def __init__(self, codec: MessageCodec, signals: Mapping[str, str]) -> None:
        self.codec = codec
        self.signals = tuple(signals)
        chosen = [(_signal(codec, name), _factor(codec, name, unit)) for name, unit in signals.items()]
        self.factors = tuple(factor for _, factor in chosen)
        layout = [signal for signal, _ in chosen]
        self.decode = codegen.compile_function(_decode_source(chosen, codec.length), codec.name, layout)
        self.encode = codegen.compile_function(_encode_source(chosen, codec), codec.name, layout)


def _signal(codec: MessageCodec, name: str) -> Signal:
    if codec.is_multiplexed:
        raise ValueError(f"{codec.name} is multiplexed; a binding needs signals that are always present")
    if name not in codec.by_signal:
        raise ValueError(f"{codec.name} has no signal {name}; it has {', '.join(codec.signals)}")
    return codec.by_signal[name]


def _factor(codec: MessageCodec, name: str, unit: str) -> float:
    try:
        return factor_to(unit, codec.by_signal[name].unit)
    except ValueError as error:
        raise ValueError(f"{codec.name}.{name}: {error}") from None


def _decode_source(chosen: Sequence[tuple[Signal, float]], length: int) -> str:
    """`decode(data)`: like the codec's, then times the unit's factor."""
    values = "".join(f"        {_si_expression(i, s, f, length)},\n" for i, (s, f) in enumerate(chosen))
    opening = codegen.open_frame([signal for signal, _ in chosen], length)
    return f"def decode(data):\n{opening}    return (\n{values}    )\n"


def _si_expression(i: int, signal: Signal, factor: float, length: int) -> str:
    raw = codegen.raw_expression(signal, length)
    # a range check is generated only where the bits can hold codes outside the range
    partial = not signal.is_float and not signal.choices and signal.raw_range != signal.raw_limits
    physical = codegen.physical_expression(signal, f"r{i}" if partial else raw)
    value = physical if factor == 1 else f"({physical}) * {factor!r}"
    if not partial:
        return value
    lowest, highest = signal.raw_range
    return f"{value} if {lowest} <= (r{i} := {raw}) <= {highest} else nan"


def _encode_source(chosen: Sequence[tuple[Signal, float]], codec: MessageCodec) -> str:
    """`encode(values)`: saturated frame from SI values."""
    lines = ["def encode(values):", f"    {', '.join(f'v{i}' for i in range(len(chosen)))}, = values"]
    parts = []
    for i, (signal, factor) in enumerate(chosen):
        lines += _saturated(i, signal, factor)
        parts.append((signal, codegen.place(signal, f"r{i}", codec.length)))
    named = {signal.name for signal, _ in chosen}
    parts += [
        (s, codegen.place(s, str(resting(s)), codec.length)) for s in codec.layout if s.name not in named
    ]
    lines.append(f"    return {codegen.close_frame(parts, codec.length)}\n")
    return "\n".join(lines)


def _saturated(i: int, signal: Signal, factor: float) -> list[str]:
    """Statements that leave the raw bits of `v<i>` in `r<i>`."""
    if signal.is_float:
        return [f"    r{i} = {codegen.raw_bits(signal, _from_si(i, factor))}"]
    scaled = f"({_from_si(i, factor)} - {signal.offset!r}) / {signal.scale!r}"
    lowest, highest = signal.raw_range
    absent = signal.not_available
    nan = f"no_number(label, ((signals[{i}], v{i}),))" if absent is None else str(absent)
    # x == x is false for NaN only, and needs no function call in the generated code
    inside = f"round(x) if x == x else {nan}"
    return [
        f"    x = {scaled}",
        f"    r{i} = {lowest} if x <= {lowest} else {highest} if x >= {highest} else {inside}",
    ]


def _from_si(i: int, factor: float) -> str:
    return f"v{i}" if factor == 1 else f"v{i} / {factor!r}"


def resting(signal: Signal) -> int:
    """Raw value of a signal that is not sent."""
    # CRC and counter are set by the protector afterwards; all ones there would be a value, not "absent"
    return 0 if signal.name in _PROTECTION else signal.not_available or 0
