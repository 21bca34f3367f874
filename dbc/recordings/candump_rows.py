"""Lines of a candump log from frames as rows, in compiled code: the same text as `writer.candump_line`, without an object for each frame."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from bus.frame import ERROR, EXTENDED, EXTENDED_MASK, REMOTE, STANDARD_MASK
from dbc.compiled import released

_DIGITS: Final = np.frombuffer(b"0123456789ABCDEF", np.uint8)
_FIXED: Final = len("(0123456789.012345)  01234567#0011223344556677\n")
"""Bytes of the longest line without the name of its channel."""


def lines_of(table: NDArray[np.void], channel: str) -> str:
    """The lines of a table of bus.rows.LAYOUT, each with its end."""
    if not len(table):
        return ""
    name = np.frombuffer(channel.encode("ascii"), np.uint8)
    out = np.empty(len(table) * (_FIXED + name.size), np.uint8)
    size = write_lines(table["at_ns"], table["can_id"], table["length"], table["data"], name, out)
    return out[:size].tobytes().decode("ascii")


@released
def write_lines(at_ns: Any, can_id: Any, length: Any, data: Any, channel: Any, out: Any) -> int:
    """Fill `out`; returns how many bytes."""
    at = 0
    for k in range(len(at_ns)):
        word, micros = np.int64(can_id[k]), at_ns[k] // 1000
        out[at] = 40  # (
        _decimal(micros // 1_000_000, 10, out, at + 1)
        out[at + 11] = 46  # .
        _decimal(micros % 1_000_000, 6, out, at + 12)
        out[at + 18], out[at + 19] = 41, 32  # ) and a space
        at += 20
        for byte in channel:
            out[at] = byte
            at += 1
        out[at] = 32
        at += 1
        if word & ERROR:
            at = _hexadecimal(word & (EXTENDED_MASK | ERROR), 8, out, at)
        elif word & EXTENDED:
            at = _hexadecimal(word & EXTENDED_MASK, 8, out, at)
        else:
            at = _hexadecimal(word & STANDARD_MASK, 3, out, at)
        out[at] = 35  # number sign
        at += 1
        if word & REMOTE:
            out[at] = 82  # R
            at += 1
            if length[k]:
                out[at] = 48 + length[k]
                at += 1
        else:
            for j in range(length[k]):
                at = _hexadecimal(np.int64(data[k, j]), 2, out, at)
        out[at] = 10
        at += 1
    return at


@released
def _decimal(value: Any, digits: Any, out: Any, at: Any) -> None:
    for k in range(digits - 1, -1, -1):
        out[at + k] = 48 + value % 10
        value //= 10


@released
def _hexadecimal(value: Any, digits: Any, out: Any, at: Any) -> Any:
    for k in range(digits):
        out[at + k] = _DIGITS[value >> 4 * (digits - 1 - k) & 15]
    return at + digits
