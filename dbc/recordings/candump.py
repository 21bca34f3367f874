"""The compiled parser of candump logs: text bytes in, rows of numbers out, one pass.

A line is `(seconds.fraction) channel IDENTIFIER#DATA`, by can-utils' lib.c:

    123#1122            11-bit identifier, three digits        18FEF100#11    29-bit, eight digits
    123##1AABB          CAN FD: one digit of flags, then data  123#R4         remote, length optional
    123#11.22           bytes may be separated by dots         123#..._B      raw DLC after 8 bytes
    20000080#00000000   error frame: eight digits with the error bit
    123#1122 R          direction, R or T, as `candump -x` appends it

Each step takes the text, a position and the line's end, and returns the position after what it read,
or a negative reason. Lines as candump itself writes them are read eight bytes at a time (`_usual_lines`); all others,
and all damage, are left to the steps.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from bus.frame import ERROR, EXTENDED, FD, REMOTE
from bus.machine_code import IN_PYTHON
from dbc.compiled import inlined, merged, released

_step = merged  # a call per step would cost a third more

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

# Of each byte of a word: its lowest bit, its highest bit.
_ONES, _HIGHEST = np.uint64(0x0101_0101_0101_0101), np.uint64(0x8080_8080_8080_8080)
_ONE, _ALL = np.uint64(1), np.uint64(0xFFFF_FFFF_FFFF_FFFF)
_CLOSE_AND_SPACE = np.uint64(_SPACE << 8 | _CLOSE)
_LONGEST_PAUSE = 63
_USUAL_ROOM = 64  # a usual line has at most 54 bytes, and is read eight bytes at a time


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


def _one_load(typing_context: Any, text: Any, at: Any) -> Any:
    """Eight bytes text[at:at + 8] as a little-endian word, the first one lowest.

    Written with numba's own instrument, because the compiler does not join eight loads of a byte.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        begin = builder.gep(array.data, [arguments[1]])
        word: Any = builder.load(builder.bitcast(begin, ir.IntType(64).as_pointer()))
        word.align = 1
        return word

    return types.uint64(text, types.intp), generate


_eight: Any = intrinsic(_one_load)


@inlined
def _below_lowest(marks: Any) -> Any:
    """All bits of the bytes below the lowest byte whose highest bit is set in `marks`."""
    # all ones for no mark, as 0 - 1 does
    return ((marks & (~marks + _ONE)) >> np.uint64(7)) - _ONE


@inlined
def _bytes_of(below: Any) -> Any:
    """Number of bytes that `_below_lowest` found."""
    return np.int64(((below & _ONES) * _ONES) >> np.uint64(56))


@inlined
def _hexadecimal(word: Any) -> Any:
    """Values of eight hexadecimal digits as four bytes, first digit highest, and the bits of the leading bytes that are digits.

    Digits behind the first byte that is none count as 0. Ranges are compared by the carry into the highest bit of a
    byte, which ASCII leaves free (Lamport, Multiple byte processing with full-word instructions, 1975).
    """
    lower = word | _ONES * np.uint64(0x20)
    decimal = (word + _ONES * np.uint64(0x80 - 48)) & ~(word + _ONES * np.uint64(0x7F - 57))
    letter = (lower + _ONES * np.uint64(0x80 - 97)) & ~(lower + _ONES * np.uint64(0x7F - 102))
    # a byte beyond ASCII carries into its neighbour above, and ends the digits itself
    below = _below_lowest((~(decimal | letter) | word) & _HIGHEST)
    digits = ((word & _ONES * np.uint64(15)) + ((letter & _HIGHEST) >> np.uint64(7)) * np.uint64(9)) & below
    pairs = (digits << np.uint64(4) | digits >> np.uint64(8)) & np.uint64(0x00FF00FF00FF00FF)
    pairs = (pairs | pairs >> np.uint64(8)) & np.uint64(0x0000FFFF0000FFFF)
    return (pairs | pairs >> np.uint64(16)) & np.uint64(0xFFFFFFFF), below


@inlined
def _six_decimals(word: Any) -> Any:
    """Value of six decimal digits in the lower bytes of a word, -1 if they are none."""
    word = word << np.uint64(16) | np.uint64(0x3030)
    decimal = (word + _ONES * np.uint64(0x80 - 48)) & ~(word + _ONES * np.uint64(0x7F - 57)) & ~word
    if decimal & _HIGHEST != _HIGHEST:
        return np.int64(-1)
    # two, four, eight digits at a time
    word = ((word & _ONES * np.uint64(15)) * np.uint64(2561)) >> np.uint64(8)
    word = ((word & np.uint64(0x00FF00FF00FF00FF)) * np.uint64(6553601)) >> np.uint64(16)
    return np.int64(((word & np.uint64(0x0000FFFF0000FFFF)) * np.uint64(42949672960001)) >> np.uint64(32))


@released
def _usual_lines(text: Any, at: Any, row: Any, columns: Any, keys: Any, known: Any, digits: Any) -> Any:
    """Read lines `(seconds.microseconds) channel IDENTIFIER#DATA` from `at` on into rows from `row` on.

    It ends before the first other line, also before one of a channel that is not among `keys`, and _USUAL_ROOM bytes
    before the end; returns where, and the row reached.
    """
    time_ns, can_id, length, flags, data, channel = columns
    end = text.size - _USUAL_ROOM
    line = at
    while line < end:
        at = line
        if text[at] != _OPEN:
            break
        at += 1
        last, seconds = at + 10, np.int64(0)
        while at < last and np.uint8(text[at] - 48) <= 9:
            seconds = seconds * 10 + np.int64(text[at] - 48)
            at += 1
        word = _eight(text, at + 1)
        microseconds = _six_decimals(word)
        if (
            at == last - 10
            or text[at] != _DOT
            or microseconds < 0
            or word >> np.uint64(48) != _CLOSE_AND_SPACE
        ):
            break
        at += 9
        word = _eight(text, at)
        blank = word ^ _ONES * np.uint64(_SPACE)
        below = _below_lowest((blank - _ONES) & ~blank & _HIGHEST)
        key, number = word & below, 0
        while number < known and keys[number] != key:
            number += 1
        if number == known or key == 0:
            break
        at += _bytes_of(below) + 1
        at, identifier = _usual_identifier(text, at, digits)
        if at < 0:
            break
        value, below = _hexadecimal(_eight(text, at))
        count = _bytes_of(below)
        if below == _ALL:
            upper, below = _hexadecimal(_eight(text, at + 8))
            value |= upper << np.uint64(32)
            count = 8 + _bytes_of(below)
        at += count
        if text[at] == _RETURN:
            at += 1
        if text[at] != _NEWLINE or count & 1:
            break
        for k in range(CLASSIC_BYTES):
            data[row, k] = np.uint8(value >> np.uint64(8 * k))
        for k in range(CLASSIC_BYTES, data.shape[1]):
            data[row, k] = 0
        time_ns[row] = (seconds * 1_000_000 + microseconds) * 1000
        can_id[row], length[row], flags[row], channel[row] = identifier, count >> 1, 0, number
        row += 1
        line = at + 1
    return line, row


@inlined
def _usual_identifier(text: Any, at: Any, digits: Any) -> Any:
    """Identifier and '#': position, negative if they are not there, and `can_id` word."""
    if text[at + 8] == _HASH:
        value, below = _hexadecimal(_eight(text, at))
        # the first digit is the highest: the bytes are turned round
        word = np.uint32(
            (value & np.uint64(0xFF)) << np.uint64(24)
            | (value & np.uint64(0xFF00)) << np.uint64(8)
            | (value & np.uint64(0xFF0000)) >> np.uint64(8)
            | value >> np.uint64(24)
        )
        if below != _ALL or word > _HIGHEST_EXTENDED:
            return np.int64(-1), word
        return at + 9, np.uint32(word | np.uint32(EXTENDED))
    high, middle, low = digits[text[at]], digits[text[at + 1]], digits[text[at + 2]]
    word = np.uint32(high << 8 | middle << 4 | low)
    if high | middle | low > _HIGHEST_DIGIT or word > _HIGHEST_STANDARD or text[at + 3] != _HASH:
        return np.int64(-1), word
    return at + 4, word


@inlined
def _key(text: Any, start: Any, end: Any) -> Any:
    """A channel's name as a word; 0, which none is, for one of more than seven bytes."""
    key = np.uint64(0)
    if end - start > 7:
        return key
    for k in range(end - start):
        key |= np.uint64(text[start + k]) << np.uint64(8 * k)
    return key


@released
def parse(text: Any, columns: Any, starts: Any, ends: Any, bad_line: Any, bad_code: Any, digits: Any) -> Any:
    """Parse every line of `text`; returns rows, lines, damaged lines and channels found.

    columns: time_ns, can_id, length, flags, data (rows, 8 or 64), channel, with a row for every line.
    rows is TOO_NARROW if a CAN FD frame came and data has only 8 columns.
    starts, ends: where in the text each channel's name was first met. bad_line, bad_code: the first damaged lines.
    """
    data = columns[4]
    row, line, bad, known, at, size = 0, 0, 0, 0, 0, text.size
    # lines that are not tried as usual ones: after the next one, from here on; Python cannot load eight bytes as one
    pause, others = 0, text.size if IN_PYTHON else 0
    keys = np.zeros(CHANNELS + 1, np.uint64)
    while at < size:
        if others:
            others -= 1
        else:
            first = row
            at, row = _usual_lines(text, at, row, columns, keys, known, digits)
            line += row - first
            # where no line is usual (CAN FD, another writer), ever fewer are tried
            pause = 0 if row > first else min(2 * pause + 1, _LONGEST_PAUSE)
            others = pause
        end = at
        while end < size and text[end] != _NEWLINE:
            end += 1
        line += 1
        before = known
        data[row, :] = 0
        result, known = _line(text, at, end, row, columns, starts, ends, known, digits)
        if known > before:
            keys[before] = _key(text, starts[before], ends[before])
        if result >= 0:
            row += 1
        elif result == TOO_NARROW:
            return TOO_NARROW, line, bad, known
        elif result != BLANK:
            if bad < bad_line.size:
                bad_line[bad], bad_code[bad] = line, result
            bad += 1
        at = end + 1
    return row, line, bad, known
