"""The compiled parser of candump logs: text bytes in, rows of numbers out, one pass.

A line is `(seconds.fraction) channel IDENTIFIER#DATA`, by can-utils' lib.c:

    123#1122            11-bit identifier, three digits        18FEF100#11    29-bit, eight digits
    123##1AABB          CAN FD: one digit of flags, then data  123#R4         remote, length optional
    123#11.22           bytes may be separated by dots         123#..._B      raw DLC after 8 bytes
    20000080#00000000   error frame: eight digits with the error bit
    123#1122 R          direction, R or T, as `candump -x` appends it

Each step takes the text, a position and the line's end, and returns the position after what it read,
or a negative reason.
"""

from typing import Any

import numpy as np
from numba import njit

from bus.frame import ERROR, EXTENDED, FD, REMOTE

_step = njit(cache=True, nogil=True, inline="always")  # a call per step would cost a third more

CHANNELS = 64
CLASSIC_BYTES, FD_BYTES = 8, 64

BLANK, BAD_STAMP, BAD_CHANNEL, BAD_IDENTIFIER, NO_SEPARATOR, BAD_DATA, TOO_LONG, BAD_END, TOO_NARROW = range(
    -1, -10, -1
)
REASONS = {
    BAD_STAMP: "no time stamp '(seconds.fraction)' at its start",
    BAD_CHANNEL: f"no channel name, or more than {CHANNELS} different ones",
    BAD_IDENTIFIER: "identifier is not 3 or 8 hexadecimal digits of an existing identifier",
    NO_SEPARATOR: "no '#' after the identifier",
    BAD_DATA: "data is not pairs of hexadecimal digits",
    TOO_LONG: "more data than a frame holds (8 bytes, CAN FD 64)",
    BAD_END: "something follows the data",
}

_SPACE, _TAB, _RETURN, _NEWLINE = 32, 9, 13, 10
_OPEN, _CLOSE, _DOT, _HASH, _UNDERSCORE = 40, 41, 46, 35, 95
_R, _T, _LOWER_R = 82, 84, 114
_NO_DIGIT, _HIGHEST_DIGIT = 255, 15  # a bitwise or of digits stays at 15 or below

_OTHER_FLAGS = np.uint32(EXTENDED | REMOTE)
_HIGHEST_EXTENDED, _HIGHEST_STANDARD = np.uint32(0x1FFF_FFFF), np.uint32(0x7FF)


def _digit_values() -> Any:
    """Value of every byte as a hexadecimal digit, 255 for those that are none."""
    values = np.full(256, _NO_DIGIT, np.uint8)
    for value, digit in enumerate("0123456789ABCDEF"):
        values[ord(digit)] = values[ord(digit.lower())] = value
    return values


DIGITS = _digit_values()


@_step
def _skip_blanks(text: Any, at: Any, end: Any) -> Any:
    while at < end and (text[at] == _SPACE or text[at] == _TAB):
        at += 1
    return at


@_step
def _stamp(text: Any, at: Any, end: Any) -> Any:
    """`(seconds.fraction)`: position and nanoseconds; digits beyond nanoseconds are dropped."""
    if text[at] != _OPEN:
        return BAD_STAMP, np.int64(0)
    at += 1
    first = at
    nanoseconds, weight = np.int64(0), np.int64(1_000_000_000)
    while at < end and 48 <= text[at] <= 57:
        nanoseconds = nanoseconds * 10 + (text[at] - 48)
        at += 1
    if at == first or at - first > 10:
        return BAD_STAMP, np.int64(0)
    if at < end and text[at] == _DOT:
        at += 1
        while at < end and 48 <= text[at] <= 57:
            if weight > 1:
                nanoseconds = nanoseconds * 10 + (text[at] - 48)
                weight //= 10
            at += 1
    if at >= end or text[at] != _CLOSE:
        return BAD_STAMP, np.int64(0)
    return at + 1, nanoseconds * weight


@_step
def _channel(text: Any, start: Any, end: Any, starts: Any, ends: Any, known: Any) -> Any:
    """Number of the channel named by text[start:end]; `known` if it is a new one."""
    for number in range(known):
        if ends[number] - starts[number] == end - start:
            same = True
            for k in range(end - start):
                if text[starts[number] + k] != text[start + k]:
                    same = False
                    break
            if same:
                return number
    return known


@_step
def _identifier(text: Any, at: Any, end: Any, digits: Any) -> Any:
    """Identifier and '#': position and `can_id` word."""
    first, word = at, np.uint32(0)
    while at < end and digits[text[at]] != _NO_DIGIT and at - first < 9:
        word = np.uint32(word << np.uint32(4) | np.uint32(digits[text[at]]))
        at += 1
    if at - first == 3:
        if word > _HIGHEST_STANDARD:
            return BAD_IDENTIFIER, word
    elif at - first == 8:
        if word & np.uint32(ERROR):
            if word & _OTHER_FLAGS:
                return BAD_IDENTIFIER, word
        elif word > _HIGHEST_EXTENDED:
            return BAD_IDENTIFIER, word
        else:
            word |= np.uint32(EXTENDED)
    else:
        return BAD_IDENTIFIER, word
    if at >= end or text[at] != _HASH:
        return NO_SEPARATOR, word
    return at + 1, word


@_step
def _bytes(text: Any, at: Any, end: Any, most: Any, data: Any, row: Any, digits: Any) -> Any:
    """Pairs of digits into `data`: position and number of bytes."""
    count = 0
    while at + 1 < end:
        high, low = digits[text[at]], digits[text[at + 1]]
        if high | low > _HIGHEST_DIGIT:
            if text[at] != _DOT or count == 0:
                break
            at += 1
            continue
        if count == most:
            return TOO_LONG, count
        data[row, count] = high << 4 | low
        count += 1
        at += 2
    if at < end and digits[text[at]] != _NO_DIGIT:
        return BAD_DATA, count
    return at, count


@_step
def _end(text: Any, at: Any, end: Any) -> Any:
    """What may follow the data: a raw DLC, a direction."""
    if at + 1 < end and text[at] == _UNDERSCORE:
        at += 2
    if at + 2 == end and text[at] == _SPACE and (text[at + 1] == _R or text[at + 1] == _T):
        at = end
    if at < end:
        return BAD_END if text[at] == _SPACE else BAD_DATA
    return at


@_step
def _line(
    text: Any, at: Any, end: Any, row: Any, columns: Any, starts: Any, ends: Any, known: Any, digits: Any
) -> Any:
    """Parse text[at:end] into row `row`: a position (0 or more) or a reason, and the channels known."""
    time_ns, can_id, length, flags, data, channel = columns
    at = _skip_blanks(text, at, end)
    while end > at and (text[end - 1] == _SPACE or text[end - 1] == _TAB or text[end - 1] == _RETURN):
        end -= 1
    if at == end:
        return BLANK, known
    at, nanoseconds = _stamp(text, at, end)
    if at < 0:
        return at, known
    name_start = _skip_blanks(text, at, end)
    name_end = name_start
    while name_end < end and text[name_end] != _SPACE:
        name_end += 1
    number = _channel(text, name_start, name_end, starts, ends, known)
    if name_start == name_end or name_end == end or number == CHANNELS:
        return BAD_CHANNEL, known
    at, word = _identifier(text, _skip_blanks(text, name_end, end), end, digits)
    if at < 0:
        return at, known
    flag, count = np.uint8(0), 0
    if at < end and text[at] == _HASH:
        if at + 1 >= end or digits[text[at + 1]] == _NO_DIGIT:
            return BAD_DATA, known
        if data.shape[1] < FD_BYTES:
            return TOO_NARROW, known
        flag = np.uint8(digits[text[at + 1]] | FD)
        at, count = _bytes(text, at + 2, end, FD_BYTES, data, row, digits)
    elif at < end and (text[at] == _R or text[at] == _LOWER_R):
        word |= np.uint32(REMOTE)
        at += 1
        if at < end and 48 <= text[at] <= 56:
            count = text[at] - 48
            at += 1
    else:
        at, count = _bytes(text, at, end, CLASSIC_BYTES, data, row, digits)
    if at >= 0:
        at = _end(text, at, end)
    if at < 0:
        return at, known
    if number == known:
        starts[known], ends[known] = name_start, name_end
        known += 1
    time_ns[row], can_id[row], length[row], flags[row], channel[row] = nanoseconds, word, count, flag, number
    return at, known


@njit(cache=True, nogil=True)
def parse(text: Any, columns: Any, starts: Any, ends: Any, bad_line: Any, bad_code: Any, digits: Any) -> Any:
    """Parse every line of `text`; returns rows, lines, damaged lines and channels found.

    columns: time_ns, can_id, length, flags, data (rows, 8 or 64; zeroed), channel, with a row for every line.
    rows is TOO_NARROW if a CAN FD frame came and data has only 8 columns.
    starts, ends: where in the text each channel's name was first met. bad_line, bad_code: the first damaged lines.
    """
    data = columns[4]
    row, line, bad, known, at, size = 0, 0, 0, 0, 0, text.size
    while at < size:
        end = at
        while end < size and text[end] != _NEWLINE:
            end += 1
        line += 1
        result, known = _line(text, at, end, row, columns, starts, ends, known, digits)
        if result >= 0:
            row += 1
        elif result == TOO_NARROW:
            return TOO_NARROW, line, bad, known
        elif result != BLANK:
            data[row, :] = 0
            if bad < bad_line.size:
                bad_line[bad], bad_code[bad] = line, result
            bad += 1
        at = end + 1
    return row, line, bad, known
