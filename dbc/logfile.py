"""Reads candump logs (`candump -L`, python-can's CanutilsLogWriter) into arrays, at memory speed.

    (1436509052.249713) vcan0 044#2A366C2BBA          classic, 11 bit
    (0.170500) can0 0CF00300#FF0018FF07FFFFFF         29 bit: eight hexadecimal digits
    (0.1) can0 123##1AABB                             CAN FD: one digit of flags, then data
    (0.1) can0 123#R4                                 remote frame
    (0.1) can0 20000080#0000000000000000              error frame

A line that is none of these is damaged: counted, reported with its number and reason, skipped.
The parser is one compiled pass over the bytes.
"""

import gzip
import io
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from bus.frame import ERROR, EXTENDED, FD, REMOTE
from dbc.errors import LogError

CHUNK = 8 << 20
DAMAGE_SHOWN = 100
"""Damaged lines that are kept with their number and reason; all are counted."""
CHANNELS = 64
WIDTH = 64

_OK, _BLANK, _STAMP, _CHANNEL, _IDENTIFIER, _SEPARATOR, _DIGITS, _TOO_LONG, _REST = range(9)
_REASONS = {
    _STAMP: "no time stamp '(seconds.fraction)' at its start",
    _CHANNEL: "no channel name, or more than 64 different ones",
    _IDENTIFIER: "identifier is not 3 or 8 hexadecimal digits of an existing identifier",
    _SEPARATOR: "no '#' after the identifier",
    _DIGITS: "data is not pairs of hexadecimal digits",
    _TOO_LONG: "more data than a frame holds (8 bytes, CAN FD 64)",
    _REST: "something follows the data",
}


@dataclass(frozen=True, slots=True)
class Damage:
    """A line that could not be read."""

    line: int
    reason: str

    def __str__(self) -> str:
        return f"line {self.line}: {self.reason}; skipped"


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameTable:
    """The frames of a recording, one row each, in the order of the file.

    time_ns: (n,) int64; can_id: (n,) uint32 `can_id` words; length: (n,) uint8; flags: (n,) uint8 CAN FD flags;
    data: (n, 64) uint8, zero beyond length ((n, 8) when no frame is longer); channel: (n,) uint8 index into channels.
    damaged: the first 100 damaged lines; damaged_count: how many there were.
    """

    time_ns: NDArray[np.int64]
    can_id: NDArray[np.uint32]
    length: NDArray[np.uint8]
    flags: NDArray[np.uint8]
    data: NDArray[np.uint8]
    channel: NDArray[np.uint8]
    channels: tuple[str, ...]
    damaged: tuple[Damage, ...] = ()
    damaged_count: int = 0

    def __len__(self) -> int:
        return int(self.time_ns.size)


def _hex_table() -> NDArray[np.uint8]:
    table = np.full(256, 255, np.uint8)
    for value, digit in enumerate("0123456789ABCDEF"):
        table[ord(digit)] = table[ord(digit.lower())] = value
    return table


_HEX = _hex_table()


@njit(cache=True, nogil=True)
def _parse_line(
    text: Any, at: Any, end: Any, out: Any, row: Any, starts: Any, sizes: Any, known: Any, hexes: Any
) -> Any:
    """Parse text[at:end] into row `row`; returns a status code, and the number of known channels."""
    time_ns, can_id, length, flags, data, channel = out
    while at < end and (text[at] == 32 or text[at] == 9):
        at += 1
    while end > at and (text[end - 1] == 32 or text[end - 1] == 9 or text[end - 1] == 13):
        end -= 1
    if at == end:
        return _BLANK, known
    if text[at] != 40:  # (
        return _STAMP, known
    at += 1
    seconds, digits = np.int64(0), 0
    while at < end and 48 <= text[at] <= 57 and digits < 10:
        seconds = seconds * 10 + (text[at] - 48)
        at += 1
        digits += 1
    fraction, scale = np.int64(0), np.int64(1_000_000_000)
    if at < end and text[at] == 46:  # .
        at += 1
        while at < end and 48 <= text[at] <= 57:
            if scale > 1:
                fraction = fraction * 10 + (text[at] - 48)
                scale //= 10
            at += 1
    if digits == 0 or at >= end or text[at] != 41:  # )
        return _STAMP, known
    at += 1
    while at < end and text[at] == 32:
        at += 1
    start = at
    while at < end and text[at] != 32:
        at += 1
    size = at - start
    index = -1
    for i in range(known):
        if sizes[i] == size:
            same = True
            for k in range(size):
                if text[starts[i] + k] != text[start + k]:
                    same = False
                    break
            if same:
                index = i
                break
    if size == 0 or at == end:
        return _CHANNEL, known
    while at < end and text[at] == 32:
        at += 1
    start_id = at
    identifier = np.uint32(0)
    while at < end and hexes[text[at]] != 255 and at - start_id < 9:
        identifier = np.uint32(identifier * 16 + hexes[text[at]])
        at += 1
    count = at - start_id
    if not (count == 3 or count == 8):
        return _IDENTIFIER, known
    if at >= end or text[at] != 35:  # #
        return _SEPARATOR, known
    at += 1
    if count == 8:
        if identifier & np.uint32(ERROR):
            if identifier & np.uint32(0xC000_0000):
                return _IDENTIFIER, known
        elif identifier > np.uint32(0x1FFF_FFFF):
            return _IDENTIFIER, known
        else:
            identifier |= np.uint32(EXTENDED)
    elif identifier > np.uint32(0x7FF):
        return _IDENTIFIER, known
    most, flag = 8, np.uint8(0)
    size_of_data = 0
    if at < end and text[at] == 35:  # ##: CAN FD
        at += 1
        if at >= end or hexes[text[at]] == 255:
            return _DIGITS, known
        flag = np.uint8(hexes[text[at]] | FD)
        most = 64
        at += 1
    if at < end and most == 8 and (text[at] == 82 or text[at] == 114):  # R: remote
        identifier |= np.uint32(REMOTE)
        at += 1
        if at < end and 48 <= text[at] <= 56:
            size_of_data = text[at] - 48
            at += 1
    else:
        while at + 1 < end and hexes[text[at]] != 255 and hexes[text[at + 1]] != 255:
            if size_of_data == most:
                return _TOO_LONG, known
            data[row, size_of_data] = hexes[text[at]] * 16 + hexes[text[at + 1]]
            size_of_data += 1
            at += 2
            if at < end and text[at] == 46:  # bytes may be separated by dots
                at += 1
        if at < end and hexes[text[at]] != 255:
            return _DIGITS, known
    if at < end and text[at] == 95 and at + 1 < end:  # _: raw DLC of a classic frame
        at += 2
    # candump -x appends the direction
    if at < end and not (text[at] == 32 and at + 2 == end and (text[at + 1] == 82 or text[at + 1] == 84)):
        return (_DIGITS if text[at] != 32 else _REST), known
    if index < 0:
        if known == CHANNELS:
            return _CHANNEL, known
        starts[known], sizes[known] = start, size
        index = known
        known += 1
    time_ns[row] = seconds * 1_000_000_000 + fraction * scale
    can_id[row] = identifier
    length[row] = size_of_data
    flags[row] = flag
    channel[row] = index
    return _OK, known


@njit(cache=True, nogil=True)
def _parse(text: Any, out: Any, starts: Any, sizes: Any, hexes: Any, bad_line: Any, bad_code: Any) -> Any:
    """Parse every line of `text`; returns rows, lines, damaged lines and channels found."""
    data = out[4]
    row, line, bad, known, at = 0, 0, 0, 0, 0
    size = text.size
    while at < size:
        end = at
        while end < size and text[end] != 10:
            end += 1
        line += 1
        code, known = _parse_line(text, at, end, out, row, starts, sizes, known, hexes)
        if code == _OK:
            row += 1
        elif code != _BLANK:
            for k in range(WIDTH):
                data[row, k] = 0
            if bad < bad_line.size:
                bad_line[bad], bad_code[bad] = line, code
            bad += 1
        at = end + 1
    return row, line, bad, known


def _chunks(stream: io.BufferedIOBase, path: Path) -> Iterator[bytes]:
    """The stream in pieces that end at a line's end."""
    rest = b""
    while True:
        try:
            piece = stream.read(CHUNK)
        except (OSError, EOFError, zlib.error) as error:
            if rest:
                yield rest
            raise LogError(f"{path}: cannot be read to its end: {error}") from error
        if not piece:
            if rest:
                yield rest
            return
        cut = piece.rfind(b"\n") + 1
        if cut:
            yield rest + piece[:cut]
            rest = piece[cut:]
        else:
            rest += piece


class _Builder:
    """Collects the arrays of the chunks."""

    def __init__(self) -> None:
        self._parts: list[tuple[NDArray[Any], ...]] = []
        self._channels: list[str] = []
        self._lines = 0
        self._damaged: list[Damage] = []
        self._damaged_count = 0

    def add(self, text: bytes) -> None:
        buffer = np.frombuffer(text, np.uint8)
        rows = text.count(b"\n") + 2
        out = (
            np.empty(rows, np.int64),
            np.empty(rows, np.uint32),
            np.empty(rows, np.uint8),
            np.empty(rows, np.uint8),
            np.zeros((rows, WIDTH), np.uint8),
            np.empty(rows, np.uint8),
        )
        starts, sizes = np.empty(CHANNELS, np.int64), np.empty(CHANNELS, np.int64)
        bad_line, bad_code = np.empty(DAMAGE_SHOWN, np.int64), np.empty(DAMAGE_SHOWN, np.int64)
        row, lines, bad, known = _parse(buffer, out, starts, sizes, _HEX, bad_line, bad_code)
        names = [
            text[s : s + n].decode("ascii", "replace")
            for s, n in zip(starts[:known], sizes[:known], strict=True)
        ]
        for name in names:
            if name not in self._channels:
                self._channels.append(name)
        number = np.array([self._channels.index(name) for name in names] or [0], np.uint8)
        time_ns, can_id, length, flags, data, channel = (column[:row] for column in out)
        width = 8 if row == 0 or int(length.max()) <= 8 else WIDTH
        self._parts.append((time_ns, can_id, length, flags, data[:, :width].copy(), number[channel]))
        self._damaged += [
            Damage(self._lines + int(line), _REASONS[int(code)])
            for line, code in zip(bad_line[:bad], bad_code[:bad], strict=False)
        ][: DAMAGE_SHOWN - len(self._damaged)]
        self._damaged_count += bad
        self._lines += lines

    def table(self) -> FrameTable:
        width = max((part[4].shape[1] for part in self._parts), default=8)
        padded = [np.pad(part[4], ((0, 0), (0, width - part[4].shape[1]))) for part in self._parts]

        def joined(column: int, kind: type) -> NDArray[Any]:
            return (
                np.concatenate([part[column] for part in self._parts]) if self._parts else np.empty(0, kind)
            )

        return FrameTable(
            time_ns=joined(0, np.int64),
            can_id=joined(1, np.uint32),
            length=joined(2, np.uint8),
            flags=joined(3, np.uint8),
            data=np.concatenate(padded) if padded else np.empty((0, 8), np.uint8),
            channel=joined(5, np.uint8),
            channels=tuple(self._channels),
            damaged=tuple(self._damaged),
            damaged_count=self._damaged_count,
        )


def parse_candump(text: bytes) -> FrameTable:
    """The frames of a log that is in memory."""
    builder = _Builder()
    if text:
        builder.add(text)
    return builder.table()


def read_candump(path: str | Path, progress: Callable[[int, int], None] | None = None) -> FrameTable:
    """Read a log, plain or gzip-compressed; `progress` hears bytes read and bytes in all (of the file on disk).

    LogError when the file cannot be opened, or holds lines but not one frame.
    """
    path = Path(path)
    builder = _Builder()
    try:
        with path.open("rb") as raw:
            total = path.stat().st_size
            compressed = raw.peek(2)[:2] == b"\x1f\x8b"
            stream: io.BufferedIOBase = gzip.GzipFile(fileobj=raw) if compressed else raw
            for piece in _chunks(stream, path):
                builder.add(piece)
                if progress is not None:
                    progress(raw.tell(), total)
    except OSError as error:
        raise LogError(f"{path}: cannot read the log: {error.strerror or error}") from error
    table = builder.table()
    if not len(table) and table.damaged_count:
        first = table.damaged[0]
        raise LogError(
            f"{path}: not a candump log: none of its {table.damaged_count} lines is a frame (line {first.line}: {first.reason})"
        )
    return table
