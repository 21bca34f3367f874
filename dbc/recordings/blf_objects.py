"""The compiled parser of the objects in a BLF's containers: bytes in, rows of numbers out, one pass.

It reads what python-can's BLFReader reads: CAN messages, CAN FD messages of both kinds, and error frames. Layouts are those of
python-can's `can/io/blf.py`; all numbers are little-endian.
"""

from typing import Any

import numpy as np

from bus.frame import BRS, ERROR, ESI, EXTENDED, EXTENDED_MASK, FD, REMOTE, STANDARD_MASK
from dbc.compiled import inlined, released

CHANNELS = 256
LATEST_S = 9e9
"""Stamps beyond the year 2255 do not fit 64 bits of nanoseconds."""

# Why `parse` stopped.
DONE = 0  # every object was read; the last one may continue in the next container
NO_OBJECT = 1  # no object begins where one has to
FULL = 2  # no row is free
TOO_NARROW = 3  # a frame of CAN FD has more than the 8 bytes for which there is room
TOO_MANY = 4  # there are more than CHANNELS channels
# Why a frame is refused.
OTHER_LENGTH, WIDE_IDENTIFIER, STAMP, TOO_LONG = range(1, 5)

_BASE, _VERSION_1, _VERSION_2 = 16, 16, 24  # bytes of the parts of an object's header
_MESSAGE, _MESSAGE_2, _ERROR_EXT, _FD_MESSAGE, _FD_MESSAGE_64 = 1, 86, 73, 100, 101
_TEN_MICROSECONDS = 1
_EXACT = np.uint64(1 << 53)  # below it every integer is a float
_ID_EXTENDED = 0x80000000
_REMOTE_FLAG, _REMOTE_FLAG_64 = 0x80, 0x10
_FD_LENGTHS = np.array([*range(9), 12, 16, 20, 24, 32, 48, 64], np.int64)  # ISO 11898-1, table 5


@inlined
def _u16(data: Any, at: Any) -> Any:
    return np.int64(data[at]) | np.int64(data[at + 1]) << 8


@inlined
def _u32(data: Any, at: Any) -> Any:
    return _u16(data, at) | _u16(data, at + 2) << 16


@inlined
def _seconds(ticks: Any, per_second: Any) -> Any:
    """Seconds of an unsigned number of ticks, rounded once."""
    if ticks < _EXACT:
        return np.float64(ticks) / np.float64(per_second)
    # what a float cannot hold is divided in two parts
    return np.float64(ticks // per_second) + np.float64(ticks % per_second) / np.float64(per_second)


@inlined
def _signature(data: Any, at: Any) -> Any:
    """Whether an object begins here; four bytes must follow."""
    return data[at] == 76 and data[at + 1] == 79 and data[at + 2] == 66 and data[at + 3] == 74


@inlined
def _frame(data: Any, at: Any, kind: Any, begin: Any, header: Any, size: Any) -> Any:
    """Channel, identifier, flags of the identifier, CAN FD flags, announced length, length, and where how many bytes of data are.

    at: behind the object's header. A negative channel below -1: the object is not whole.
    """
    room = data.size - at
    if kind in (_MESSAGE, _MESSAGE_2):
        if room < 16:
            return -2, 0, 0, 0, 0, 0, 0, 0
        remote = data[at + 2] & _REMOTE_FLAG
        announced = np.int64(data[at + 3])
        length = min(announced, 8)
        return (
            _u16(data, at) - 1,
            _u32(data, at + 4),
            REMOTE if remote else 0,
            0,
            announced,
            length,
            at + 8,
            length,
        )
    if kind == _ERROR_EXT:
        if room < 32:
            return -2, 0, 0, 0, 0, 0, 0, 0
        announced = np.int64(data[at + 10])
        length = min(announced, 8)
        return _u16(data, at) - 1, _u32(data, at + 16), ERROR, 0, announced, length, at + 24, length
    if kind == _FD_MESSAGE:
        if room < 84:
            return -2, 0, 0, 0, 0, 0, 0, 0
        remote, bits = data[at + 2] & _REMOTE_FLAG, np.int64(data[at + 13])
        # CAN FD has no remote frames (ISO 11898-1): one that claims to be both is read as a remote frame
        fd = bits & 1 and not remote
        flags = (FD | (BRS if bits & 2 else 0) | (ESI if bits & 4 else 0)) if fd else 0
        announced = _FD_LENGTHS[min(data[at + 3], 15)]
        length = min(np.int64(data[at + 14]), 64)
        channel = _u16(data, at) - 1
        return channel, _u32(data, at + 4), REMOTE if remote else 0, flags, announced, length, at + 20, length
    if room < 40:
        return -2, 0, 0, 0, 0, 0, 0, 0
    bits, beyond = _u32(data, at + 12), np.int64(data[at + 35])
    remote = bits & _REMOTE_FLAG_64
    fd = bits & 0x1000 and not remote  # as above
    flags = (FD | (BRS if bits & 0x2000 else 0) | (ESI if bits & 0x4000 else 0)) if fd else 0
    announced, length = _FD_LENGTHS[min(data[at + 1], 15)], np.int64(data[at + 2])
    # more bytes may be announced than there are: the others are 0, as CANoe has it
    there = min(length, (beyond if beyond else size) - header - 40, room - 40)
    return (
        np.int64(data[at]) - 1, _u32(data, at + 4), REMOTE if remote else 0, flags, announced, length, at + 40, max(there, 0)
    )  # fmt: skip


@inlined
def _why_none(word: Any, is_data: Any, announced: Any, length: Any, flags: Any, stamp_s: Any) -> Any:
    """Why a frame is none, 0 if it is one; and what the reason names."""
    identifier = word & EXTENDED_MASK
    if is_data and announced != length:
        return OTHER_LENGTH, length, announced
    if identifier > (EXTENDED_MASK if word & _ID_EXTENDED else STANDARD_MASK):
        return WIDE_IDENTIFIER, identifier, 0
    if not abs(stamp_s) < LATEST_S:
        return STAMP, 0, 0
    limit = 64 if flags & FD else 8
    if announced > limit:
        return TOO_LONG, announced, limit
    return 0, 0, 0


@released
def parse(
    data: Any, at: Any, start_s: Any, columns: Any, row: Any, channels: Any, known: Any, stamps: Any, bad: Any
) -> Any:
    """Parse objects from `at` on into rows from `row` on; returns how it ended, where, the row reached, the channels known, and the bad frames.

    columns: time_ns, can_id, length, flags, data (rows, 8 or 64; zeroed), channel. channels: numbers of those known.
    start_s: added to every stamp. stamps: receives those of the first and the last frame [s], bad ones too.
    bad: (n, 4) receives reason and two numbers of the first bad frames; the stamp as a float's bits is the fourth.
    """
    time_ns, can_id, lengths, flags_of, payload, channel_of = columns
    broken, seen, end = 0, False, data.size
    stamp_bits = np.empty(1, np.float64)
    while True:
        begin = at
        while at < begin + 5 and at + 4 <= end and not _signature(data, at):
            at += 1
        if at == begin + 5 or at + 4 > end:
            whole = begin + 8 <= end
            return NO_OBJECT if whole else DONE, begin, row, known, broken
        if at + _BASE > end:
            return DONE, begin, row, known, broken
        header, version, size, kind = (
            _u16(data, at + 4),
            _u16(data, at + 6),
            _u32(data, at + 8),
            _u32(data, at + 12),
        )
        if size == 0:  # the next object would be this one, for ever
            return NO_OBJECT, begin, row, known, broken
        following = at + size
        rest = _VERSION_1 if version == 1 else _VERSION_2
        if following > end or (1 <= version <= 2 and at + _BASE + rest > end):
            return DONE, begin, row, known, broken
        holds = kind in (_MESSAGE, _MESSAGE_2, _ERROR_EXT, _FD_MESSAGE, _FD_MESSAGE_64)
        if not 1 <= version <= 2 or not holds:
            at = following
            continue
        number, word, kind_flags, flags, announced, length, source, there = _frame(
            data, at + _BASE + rest, kind, at, header, size
        )
        if number < -1:
            return DONE, begin, row, known, broken
        if row == time_ns.size:
            return FULL, begin, row, known, broken
        if flags & FD and payload.shape[1] < 64:
            return TOO_NARROW, begin, row, known, broken
        ticks = _u32(data, at + _BASE + 8) | _u32(data, at + _BASE + 12) << 32
        unit = np.uint64(100_000 if _u32(data, at + _BASE) == _TEN_MICROSECONDS else 1_000_000_000)
        stamp_s = _seconds(np.uint64(ticks), unit) + start_s
        if not seen:
            stamps[0], seen = stamp_s, True
        stamps[1] = stamp_s
        why, first, second = _why_none(word, kind_flags == 0, announced, length, flags, stamp_s)
        if why:
            if broken < bad.shape[0]:
                stamp_bits[0] = stamp_s
                bad[broken, 0], bad[broken, 1], bad[broken, 2] = why, first, second
                bad[broken, 3] = stamp_bits.view(np.int64)[0]
            broken += 1
            at = following
            continue
        place = 0
        while place < known and channels[place] != number:
            place += 1
        if place == known:
            if known == CHANNELS:
                return TOO_MANY, begin, row, known, broken
            channels[known] = number
            known += 1
        extended = EXTENDED if word & _ID_EXTENDED and kind_flags != ERROR else 0
        time_ns[row] = np.int64(np.rint(stamp_s * 1e6)) * 1000
        can_id[row] = np.uint32((word & EXTENDED_MASK) | extended | kind_flags)
        # a remote frame has no data, but a length
        lengths[row] = announced if kind_flags == REMOTE else length
        flags_of[row], channel_of[row] = flags, place
        if kind_flags != REMOTE:
            for k in range(min(there, payload.shape[1])):
                payload[row, k] = data[source + k]
        row += 1
        at = following
