"""Unpacks the integer signals of one message from all its frames in one compiled call.

Frames are gathered block by block as 64-bit words, so that each signal reads contiguous words out of the cache.
The arithmetic is that of cantools: integers stay integers where factor and offset are whole, else
raw * factor + offset in floats, in this order and without contraction.
"""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from dbc.compiled import quotients, released
from dbc.signal import Signal

# Columns of the signals' table of integers.
P_SHIFT, P_BITS, P_BIG_ENDIAN, P_SIGNED, P_MODE, P_SCALE, P_OFFSET = range(7)
# What becomes of a raw value: whole * factor + offset; float of (whole * factor) + offset; float * factor + offset.
WHOLE, WHOLE_PRODUCT, FLOAT = range(3)
_WORD = 64
_BLOCK: Final = 1024
_LIMIT = 1 << 63

Plan = tuple[NDArray[np.int64], NDArray[np.float64]]
"""Integers (n, 7) and floats (n, 2: factor, offset) of the signals."""


def fits(signal: Signal, length: int) -> bool:
    """Whether the kernel can unpack the signal of a message of `length` bytes; the caller then knows that nothing overflows.

    Left out are floats, what lies beyond the message, and scaled unsigned integers of 64 bits.
    """
    shift = signal.shift(8 * length)
    inside = shift >= 0 and shift + signal.length <= 8 * length
    unsigned_word = signal.length == _WORD and not signal.signed
    numbers = [number for number in (signal.scale, signal.offset) if isinstance(number, int)]
    return (
        inside
        and not signal.is_float
        and signal.length <= _WORD
        and all(abs(number) < _LIMIT for number in numbers)
        and (signal.is_identity or not unsigned_word)
    )


def plan_of(signals: Sequence[Signal], length: int) -> Plan:
    """The tables of signals that fit, of a message of `length` bytes."""
    integers, floats = np.zeros((len(signals), 7), np.int64), np.zeros((len(signals), 2))
    for row, signal in enumerate(signals):
        if signal.is_identity:
            mode, scale, offset = WHOLE, 1, 0
        elif not isinstance(signal.scale, int):
            mode, scale, offset = FLOAT, 0, 0
        elif isinstance(signal.offset, int):
            mode, scale, offset = WHOLE, signal.scale, signal.offset
        else:
            mode, scale, offset = WHOLE_PRODUCT, signal.scale, 0
        signed = signal.signed and signal.length < _WORD
        shift = signal.shift(8 * length)
        integers[row] = (shift, signal.length, signal.big_endian, signed, mode, scale, offset)
        floats[row] = (signal.scale, signal.offset)
    return integers, floats


def kind_of(signal: Signal) -> type[np.generic]:
    """The type of the physical values of a signal that fits."""
    if not (signal.is_identity or signal.is_integer):
        return np.float64
    return np.uint64 if signal.length == _WORD and not signal.signed else np.int64


@released
def unpack(
    words: Any, time_ns: Any, rows: Any, length: Any, integers: Any, floats: Any, whole: Any, real: Any
) -> None:
    """Stamps [s] and physical values of the frames in `rows` of a message of `length` bytes.

    words: (n, k) frames as little-endian words. whole, real: (1 + signals, rows), the same memory as int64 and as
    float64; the stamps come first, and each signal is written as what its mode says.
    """
    count = (length + 7) // 8
    big = False
    for signal in range(integers.shape[0]):
        big = big or integers[signal, P_BIG_ENDIAN] != 0
    # a row behind the last word, so that a signal that crosses no border may read it
    block = np.zeros((2, count + 1, _BLOCK), np.uint64)
    for begin in range(0, rows.size, _BLOCK):
        end = min(begin + _BLOCK, rows.size)
        for i in range(begin, end):
            real[0, i] = time_ns[rows[i]] / 1e9
        for word in range(count):
            for i in range(begin, end):
                block[0, word, i - begin] = words[rows[i], word]
        if big:
            _mirror(block, length, end - begin)
        for signal in range(integers.shape[0]):
            _signal(
                block, integers[signal], floats[signal], whole[signal + 1, begin:end], real[signal + 1, begin:end]
            )  # fmt: skip


@released
def _mirror(block: Any, length: Any, size: Any) -> None:
    """The first `length` bytes of each frame in reverse: on them one shift and mask serve Motorola signals too."""
    for word in range((length + 7) // 8):
        for i in range(size):
            block[1, word, i] = 0
    for place in range(length):
        source = length - 1 - place
        up, down = np.uint64(8 * (place % 8)), np.uint64(8 * (source % 8))
        for i in range(size):
            byte = block[0, source // 8, i] >> down & np.uint64(0xFF)
            block[1, place // 8, i] |= byte << up


@quotients
def _signal(block: Any, integers: Any, floats: Any, whole: Any, real: Any) -> None:
    """One signal of a block of frames."""
    first, bit = integers[P_SHIFT] // 64, np.uint64(integers[P_SHIFT] % 64)
    bits = integers[P_BITS]
    mask = np.uint64(0xFFFF_FFFF_FFFF_FFFF) >> np.uint64(64 - bits)
    sign = np.int64(1) << (bits - 1) if integers[P_SIGNED] else np.int64(0)
    crossing = bit + np.uint64(bits) > np.uint64(64)
    scale, offset, factor, shift = integers[P_SCALE], integers[P_OFFSET], floats[0], floats[1]
    frames = block[integers[P_BIG_ENDIAN], first]
    raw = np.empty(whole.size, np.int64)
    if crossing:
        following, left = block[integers[P_BIG_ENDIAN], first + 1], np.uint64(64) - bit
        for i in range(raw.size):
            raw[i] = (np.int64((frames[i] >> bit | following[i] << left) & mask) ^ sign) - sign
    else:
        for i in range(raw.size):
            raw[i] = (np.int64(frames[i] >> bit & mask) ^ sign) - sign
    if integers[P_MODE] == WHOLE:
        for i in range(raw.size):
            whole[i] = raw[i] * scale + offset
    elif integers[P_MODE] == WHOLE_PRODUCT:
        for i in range(raw.size):
            real[i] = np.float64(raw[i] * scale) + shift
    else:
        for i in range(raw.size):
            real[i] = np.float64(raw[i]) * factor + shift
