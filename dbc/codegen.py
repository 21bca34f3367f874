"""Writes the Python source of one message's codec and compiles it, for `dbc.database` and `dbc.binding`.

A frame is read as one integer (one per byte order in use), every signal is a shift, a mask,
for two's complement an exclusive-or and a subtraction, then raw * scale + offset in exactly
the order of operations of cantools, so that results are equal bit for bit. Source text
contains numbers only; names reach it through the namespace or as quoted literals.
"""

import math
from collections.abc import Callable, Sequence
from struct import Struct
from typing import Any

from dbc.errors import DecodeError, EncodeError
from dbc.signal import Signal

Number = int | float
_FLOATS = {16: Struct("<e"), 32: Struct("<f"), 64: Struct("<d")}


def compile_function(source: str, label: str, signals: Sequence[Signal]) -> Callable[..., Any]:
    """Execute `source`, which defines one function, and return it; errors and tracebacks show `label`."""
    namespace: dict[str, Any] = {
        "label": label,
        "signals": tuple(signals),
        "from_bytes": int.from_bytes,
        "fit": fit,
        "no_fit": no_fit,
        "no_number": no_number,
        "no_branch": no_branch,
        "nan": math.nan,
        **{f"read{bits}": layout.unpack for bits, layout in _FLOATS.items()},
        **{f"write{bits}": layout.pack for bits, layout in _FLOATS.items()},
    }
    known = set(namespace)
    # The label is shown as the file name in tracebacks. Nothing of a DBC's text is executed: names enter only
    # through the namespace or as quoted literals, because a DBC may come from a stranger.
    exec(compile(source, f"<codec of {label}>", "exec"), namespace)
    (name,) = set(namespace) - known - {"__builtins__"}
    return namespace[name]


def open_frame(signals: Sequence[Signal], length: int) -> str:
    """Statements that bring `data` to `length` bytes and read it as integers `le` and `be`."""
    # the check is inlined: a call for each frame would cost more than the decoding of a short one
    lines = [f"    if len(data) != {length}: data = fit(label, data, {length})"]
    if any(not signal.big_endian for signal in signals):
        lines.append("    le = from_bytes(data, 'little')")
    if any(signal.big_endian for signal in signals):
        lines.append("    be = from_bytes(data, 'big')")
    return "\n".join(lines) + "\n"


def raw_expression(signal: Signal, length: int) -> str:
    """Expression for the raw value, given `le` or `be`."""
    shift, mask = signal.shift(8 * length), (1 << signal.length) - 1
    bits = "be" if signal.big_endian else "le"
    if shift:
        bits = f"{bits} >> {shift}"
    if shift + signal.length < 8 * length:
        bits = f"{bits} & {mask:#x}"
    if signal.is_float:
        return f"read{signal.length}(({bits}).to_bytes({signal.length // 8}, 'little'))[0]"
    if signal.signed:
        sign = 1 << (signal.length - 1)
        # sign extension of two's complement without a branch
        return f"(({bits}) ^ {sign:#x}) - {sign:#x}"
    return bits


def physical_expression(signal: Signal, raw: str) -> str:
    """Expression for the physical value of the raw expression, as cantools computes it."""
    if signal.is_identity:
        return raw
    product = f"({raw}) * {signal.scale!r}"
    # adding 0 turns -0.0 into 0.0: left out only where the product cannot be -0.0
    never_minus_zero = not signal.is_float and signal.scale > 0
    return product if signal.offset == 0 and never_minus_zero else f"{product} + {signal.offset!r}"


def decode_source(signals: Sequence[Signal], length: int) -> str:
    """`decode(data)`: tuple of physical values in the order of `signals`."""
    values = "".join(f"        {physical_expression(s, raw_expression(s, length))},\n" for s in signals)
    return f"def decode(data):\n{open_frame(signals, length)}    return (\n{values}    )\n"


def decode_dict_source(signals: Sequence[Signal], length: int) -> str:
    """`decode_dict(data)`: physical values by name, following the multiplexers."""
    lines = [f"def decode_dict(data):\n{open_frame(signals, length)}    values = {{}}"]
    lines += _decode_branch([s for s in signals if s.multiplexer is None], signals, length, "    ")
    lines.append("    return values\n")
    return "\n".join(lines)


def _decode_branch(
    branch: Sequence[Signal], signals: Sequence[Signal], length: int, indent: str
) -> list[str]:
    """Statements for the signals of one branch, then for what its multiplexers select."""
    lines = [
        f"{indent}values[{s.name!r}] = {physical_expression(s, raw_expression(s, length))}" for s in branch
    ]
    for selector in (s for s in branch if s.is_multiplexer):
        lines += _select(
            selector, signals, indent, lambda inner, deeper: _decode_branch(inner, signals, length, deeper)
        )
    return lines


def _select(
    selector: Signal,
    signals: Sequence[Signal],
    indent: str,
    statements: Callable[[Sequence[Signal], str], list[str]],
) -> list[str]:
    """`if` statements on the value of `selector`, one per set of values that selects the same signals."""
    # signals that the same selector values choose share one `if`
    groups: dict[frozenset[int], list[Signal]] = {}
    for signal in signals:
        if signal.multiplexer == selector.name:
            groups.setdefault(signal.multiplexer_ids, []).append(signal)
    known = frozenset().union(selector.choices, *groups)
    if not known:  # a selector that selects nothing
        return []
    key = f"selector_{signals.index(selector)}"
    lines = [
        f"{indent}{key} = int(values[{selector.name!r}])",
        f"{indent}if {key} not in {_set_literal(known)}:",
        f"{indent}    no_branch(label, {selector.name!r}, {key}, {sorted(known)!r})",
    ]
    for ids, inner in groups.items():
        lines.append(f"{indent}if {key} in {_set_literal(ids)}:")
        lines += statements(inner, indent + "    ")
    return lines


def _set_literal(values: frozenset[int]) -> str:
    return "{" + ", ".join(map(str, sorted(values))) + "}" if values else "()"


def scaled_to_raw(signal: Signal, value: str) -> str:
    """Expression for the raw value, not yet range-checked, as cantools computes it."""
    if signal.is_identity:
        return value if signal.is_float else f"round({value})"
    shifted = value if signal.offset == 0 else f"({value} - {signal.offset!r})"
    if signal.is_float:
        return f"{shifted} / {signal.scale!r}"
    if signal.is_integer and signal.scale != 1:
        # integer division keeps an exact quotient exact beyond 2**53, where a float would round it
        scale = signal.scale
        return f"round({shifted} // {scale} if {shifted} % {scale} == 0 else {shifted} / {scale})"
    return f"round({shifted})" if signal.scale == 1 else f"round({shifted} / {signal.scale!r})"


def raw_bits(signal: Signal, value: str) -> str:
    """Expression for the raw value of an integer signal, or for the bit pattern of a float one."""
    raw = scaled_to_raw(signal, value)
    return f"from_bytes(write{signal.length}({raw}), 'little')" if signal.is_float else raw


def place(signal: Signal, raw: str, length: int) -> str:
    """Expression for the signal's bits in their place, given a raw value that fits."""
    bits = f"({raw} & {(1 << signal.length) - 1:#x})" if signal.signed and not signal.is_float else raw
    shift = signal.shift(8 * length)
    return f"{bits} << {shift}" if shift else bits


def close_frame(parts: Sequence[tuple[Signal, str]], length: int) -> str:
    """Expression for the frame's bytes from the placed bits of its signals."""
    little = " | ".join(bits for signal, bits in parts if not signal.big_endian)
    big = " | ".join(bits for signal, bits in parts if signal.big_endian)
    if little and big:
        # both byte orders in one frame: the little-endian bits are placed by reversing the bytes of the whole
        swapped = f"from_bytes(({little}).to_bytes({length}, 'little'), 'big')"
        return f"({swapped} | {big}).to_bytes({length}, 'big')"
    return f"({little or big or 0}).to_bytes({length}, '{'big' if big else 'little'}')"


def encode_source(signals: Sequence[Signal], length: int) -> str:
    """`encode(values)`: the frame of the physical values in the order of `signals`."""
    lines = ["def encode(values):"]
    if signals:
        lines.append(f"    {', '.join(f'v{i}' for i in range(len(signals)))}, = values")
        lines += _checked_raw([(i, s, f"v{i}") for i, s in enumerate(signals)], "    ")
    parts = [(signal, place(signal, f"r{i}", length)) for i, signal in enumerate(signals)]
    lines.append(f"    return {close_frame(parts, length)}\n")
    return "\n".join(lines)


def encode_dict_source(signals: Sequence[Signal], length: int) -> str:
    """`encode_dict(values)`: the frame from physical values by name, following the multiplexers."""
    lines = ["def encode_dict(values):", "    le = be = 0"]
    lines += _encode_branch([s for s in signals if s.multiplexer is None], signals, length, "    ")
    lines.append(
        f"    return (from_bytes(le.to_bytes({length}, 'little'), 'big') | be).to_bytes({length}, 'big')\n"
    )
    return "\n".join(lines)


def _encode_branch(
    branch: Sequence[Signal], signals: Sequence[Signal], length: int, indent: str
) -> list[str]:
    """Statements that place the signals of one branch, then what its multiplexers select."""
    numbered = [(signals.index(signal), signal, f"values[{signal.name!r}]") for signal in branch]
    lines = _checked_raw(numbered, indent) if numbered else []
    for i, signal, _ in numbered:
        lines.append(f"{indent}{'be' if signal.big_endian else 'le'} |= {place(signal, f'r{i}', length)}")
    for selector in (s for s in branch if s.is_multiplexer):
        lines += _select(
            selector, signals, indent, lambda inner, deeper: _encode_branch(inner, signals, length, deeper)
        )
    return lines


def _checked_raw(numbered: Sequence[tuple[int, Signal, str]], indent: str) -> list[str]:
    """Statements that leave each signal's raw bits in `r<number>`, or raise."""
    lines = [f"{indent}try:"]
    lines += [f"{indent}    r{i} = {raw_bits(signal, value)}" for i, signal, value in numbered]
    every = "".join(f"(signals[{i}], {value}), " for i, _, value in numbered)
    # round() raises for NaN and infinity, struct for a float that is too large: no check on the common path
    lines.append(f"{indent}except (ValueError, OverflowError): no_number(label, ({every}))")
    for i, signal, value in numbered:
        if not signal.is_float:
            lowest, highest = signal.raw_limits
            lines.append(
                f"{indent}if not {lowest} <= r{i} <= {highest}: no_fit(label, signals[{i}], {value})"
            )
    return lines


def fit(label: str, data: bytes, length: int) -> bytes:
    """The first `length` bytes. A longer frame is accepted: a newer DBC may have added signals at its end."""
    if len(data) < length:
        raise DecodeError(
            f"{label}: {len(data)} bytes of data, the DBC says {length}: another message under the same id?"
        )
    return data[:length]


def no_number(label: str, values: Sequence[tuple[Signal, Number]]) -> None:
    """Report the values that are infinite, not a number, or too large for a float signal."""
    bad = [f"{s.name} = {v} {s.unit}".rstrip() for s, v in values if not math.isfinite(v) or s.is_float]
    raise EncodeError(f"{label}: cannot encode {', '.join(bad)}")


def no_fit(label: str, signal: Signal, value: Number) -> None:
    """Report a value that the signal's bits cannot hold."""
    ends = sorted(raw * signal.scale + signal.offset for raw in signal.raw_limits)
    raise EncodeError(
        f"{label}.{signal.name}: {value} {signal.unit} does not fit; "
        f"its bits hold {ends[0]} to {ends[1]} {signal.unit}"
    )


def no_branch(label: str, name: str, value: int, known: Sequence[int]) -> None:
    """Report a multiplexer value that selects nothing."""
    raise DecodeError(
        f"{label}: multiplexer {name} is {value}, the DBC knows {', '.join(map(str, known)) or 'none'}"
    )
