"""Reads candump logs (`candump -L`, python-can's CanutilsLogWriter) into arrays, at memory speed.

A line that is no frame is damaged: counted, reported with its number and reason, skipped
(`dbc.recordings.candump` has the grammar). What can be read of a cut-off compressed file is kept.
"""

import os
import zlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any, BinaryIO, Literal, Self

import numpy as np
from numpy.typing import NDArray

from bus.bounded_json import printable
from bus.frame import REMOTE, Frame
from dbc.errors import LogError
from dbc.recordings import candump

CHUNK = 1 << 20
"""Bytes that are inflated at a time."""
PIECE = 4 << 20
"""Bytes of text that are parsed at a time, some 90 000 frames: what belongs to one piece stays in the caches."""
DAMAGE_SHOWN = 100
"""Damaged lines that are kept with their number and reason; all are counted."""
_GZIP = b"\x1f\x8b"
_GZIP_FORMAT = 16 + zlib.MAX_WBITS
LONGEST_LINE = 65_536
"""Bytes without an end of line beyond which a file is no log; the longest line of a frame has some 200."""
_ENDLESS = f"a line of more than {LONGEST_LINE} bytes; the rest of the file is not read"
INFLATION_LIMIT = 200
"""How many times longer than its file a compressed log may be; logs of a bus at rest come to some 30, gzip's most is 1032."""
INFLATION_FREE = 256 << 20
"""Bytes of text that a compressed log may have in any case."""
_SHORTEST_LINE = 10  # (0) c 123#


@dataclass(frozen=True, slots=True)
class Damage:
    """A place of a recording that could not be read."""

    at: int  # number of a line, from 1, or of a byte, from 0
    reason: str
    unit: Literal["line", "byte"] = "line"  # what `at` counts
    at_end: bool = False  # the file breaks off there; nothing between its frames is missing

    def __str__(self) -> str:
        return f"{self.unit} {self.at}: {self.reason}{'; skipped' if self.unit == 'line' else ''}"


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameTable:
    """The frames of a recording, one row each, in the order of the file."""

    time_ns: NDArray[np.int64]  # (n,) stamps as recorded: since 1970 or since a machine's start
    can_id: NDArray[np.uint32]  # (n,) Linux `can_id` words
    length: NDArray[np.uint8]  # (n,) data bytes
    flags: NDArray[np.uint8]  # (n,) CAN FD flags
    data: NDArray[np.uint8]  # (n, 64), zero beyond `length`; (n, 8) when no frame is longer
    channel: NDArray[np.uint8]  # (n,) index into `channels`
    channels: tuple[str, ...]
    # Of a piece of a recording, the damage that was found while the piece was read.
    damaged: tuple[Damage, ...] = ()  # of the first DAMAGE_SHOWN damaged places of the recording
    damaged_count: int = 0  # all damaged places

    def __len__(self) -> int:
        return int(self.time_ns.size)

    def select(self, rows: NDArray[Any]) -> Self:
        """The table of some rows only, by index or mask; channels and damage stay."""
        names = ("time_ns", "can_id", "length", "flags", "data", "channel")
        return replace(self, **{name: getattr(self, name)[rows] for name in names})

    def on_channel(self, name: str, source: str | Path) -> Self:
        """The table of one channel; LogError naming `source` and its channels if there is none of that name."""
        if name not in self.channels:
            raise LogError(f"{source}: no channel {name!r}; there are {', '.join(self.channels)}")
        table = self.select(self.channel == self.channels.index(name))
        return replace(table, channel=np.zeros_like(table.channel), channels=(name,))

    def frames(self) -> Iterator[Frame]:
        """Each row as a frame, stamped with its time in the recording."""
        columns = (self.can_id, self.length, self.time_ns, self.flags)
        for row, (can_id, length, at_ns, flags) in zip(
            self.data, zip(*(column.tolist() for column in columns), strict=True), strict=True
        ):
            data = bytes(length) if can_id & REMOTE else row[:length].tobytes()
            yield Frame(can_id, data, at_ns, flags)


@dataclass(frozen=True, slots=True)
class _Part:
    """What one piece of the text gave: columns as in FrameTable (channel numbered by `names`), damage by own lines."""

    columns: tuple[NDArray[Any], ...]
    names: tuple[str, ...]
    lines: int
    damaged: tuple[Damage, ...]
    damaged_count: int


def _parse(text: bytes, width: int = candump.CLASSIC_BYTES) -> _Part:
    """Parse whole lines; `width` is the room for data, widened when a CAN FD frame comes."""
    kinds = (np.int64, np.uint32, np.uint8, np.uint8, np.uint8, np.uint8)
    # An upper bound by the shortest possible line, so that the parser never has to grow its arrays. Memory that it does
    # not write to is not taken from the machine; counting the lines would cost half as much as parsing them.
    rows = len(text) // _SHORTEST_LINE + 1
    shapes = (rows, rows, rows, rows, (rows, width), rows)
    columns = tuple(np.empty(shape, kind) for shape, kind in zip(shapes, kinds, strict=True))
    starts, ends = np.empty((2, candump.CHANNELS), np.int64)
    bad_line, bad_code = np.empty((2, DAMAGE_SHOWN), np.int64)
    row, lines, bad, known = candump.parse(
        np.frombuffer(text, np.uint8), columns, starts, ends, bad_line, bad_code, candump.DIGITS
    )
    if row == candump.TOO_NARROW:
        return _parse(text, candump.FD_BYTES)
    shown = zip(bad_line[:bad].tolist(), bad_code[:bad].tolist(), strict=True)
    return _Part(
        columns=tuple(column[:row] for column in columns),
        names=tuple(
            printable(text[s:e].decode("ascii", "replace"))
            for s, e in zip(starts[:known], ends[:known], strict=True)
        ),
        lines=lines,
        damaged=tuple(Damage(line, candump.REASONS[code]) for line, code in shown),
        damaged_count=bad,
    )


class _Log:
    """Turns the parts of a log into tables whose channels and lines are numbered through."""

    def __init__(self) -> None:
        self._channels: list[str] = []
        self._lines = 0
        self._shown = 0

    def table(self, part: _Part) -> FrameTable:
        """The next part; LogError for too many channels."""
        self._channels += [name for name in part.names if name not in self._channels]
        if len(self._channels) > candump.CHANNELS:
            raise LogError(f"more than {candump.CHANNELS} different channel names: is this a candump log?")
        numbers = np.array([self._channels.index(name) for name in part.names] or [0], np.uint8)
        time_ns, can_id, length, flags, data, channel = part.columns
        damaged = tuple(
            Damage(self._lines + damage.at, damage.reason, at_end=damage.at_end)
            for damage in part.damaged[: DAMAGE_SHOWN - self._shown]
        )
        self._shown += len(damaged)
        self._lines += part.lines
        return FrameTable(
            time_ns=time_ns,
            can_id=can_id,
            length=length,
            flags=flags,
            data=data,
            channel=numbers[channel],
            channels=tuple(self._channels),
            damaged=damaged,
            damaged_count=part.damaged_count,
        )

    def broken(self, reason: str) -> FrameTable:
        """No frames, and the note that the file breaks off after all lines so far."""
        return self.table(replace(_parse(b""), damaged=(Damage(1, reason, at_end=True),), damaged_count=1))


def joined(pieces: Iterable[FrameTable]) -> FrameTable:
    """The pieces of a recording as one table; there must be one at least."""
    every = list(pieces)
    if len(every) == 1:
        return every[0]
    width = max(piece.data.shape[1] for piece in every)
    columns = {
        name: np.concatenate([getattr(piece, name) for piece in every])
        for name in ("time_ns", "can_id", "length", "flags", "channel")
    }
    return FrameTable(
        **columns,
        data=np.concatenate([_widened(piece.data, width) for piece in every]),
        channels=every[-1].channels,
        damaged=tuple(damage for piece in every for damage in piece.damaged),
        damaged_count=sum(piece.damaged_count for piece in every),
    )


def _widened(data: NDArray[np.uint8], width: int) -> NDArray[np.uint8]:
    return data if data.shape[1] == width else np.pad(data, ((0, 0), (0, width - data.shape[1])))


def parse_candump(text: bytes) -> FrameTable:
    """The frames of a log that is in memory."""
    return _Log().table(_parse(text))


def read_candump(path: str | Path, progress: Callable[[int, int], None] | None = None) -> FrameTable:
    """Read a log, plain or gzip-compressed; `progress` receives bytes read and bytes in all (of the file on disk).

    LogError when the file cannot be opened, or holds something but not one frame.
    """
    return joined(candump_pieces(path, progress))


def candump_pieces(
    path: str | Path, progress: Callable[[int, int], None] | None = None
) -> Iterator[FrameTable]:
    """A log as `read_candump` reads it, piece by piece: one table at least, the last may have no frame.

    Channels are numbered through; the last table names all. LogError as there, for a log without a frame at its end.
    """
    path = Path(path)
    log = _Log()
    frames, damaged, first = 0, 0, None
    try:
        with path.open("rb") as file:
            total = path.stat().st_size
            for table in _tables(file, log):
                if progress is not None:
                    progress(file.tell(), total)
                frames, damaged = frames + len(table), damaged + table.damaged_count
                first = first or next(iter(table.damaged), None)
                yield table
    except OSError as error:
        raise LogError(f"{path}: cannot read the log: {error.strerror or error}") from error
    except LogError as error:
        raise LogError(f"{path}: {error}") from None
    if not frames and first is not None:
        raise LogError(
            f"{path}: not a candump log: none of its {damaged} lines is a frame "
            f"(line {first.at}: {first.reason})"
        )


def _tables(file: BinaryIO, log: _Log) -> Iterator[FrameTable]:
    breaks: list[str] = []
    empty = True
    for part in _parsed(_gathered(_whole_lines(_pieces(file), breaks))):
        empty = False
        yield log.table(part)
    if empty and not breaks:
        yield log.table(_parse(b""))
    for reason in breaks:
        yield log.broken(reason)


def _gathered(texts: Iterator[bytes]) -> Iterator[bytes]:
    """The texts, joined until they are PIECE bytes long."""
    waiting, size = list[bytes](), 0
    for text in texts:
        waiting.append(text)
        size += len(text)
        # a read of a plain file has a line less
        if size >= PIECE - LONGEST_LINE:
            yield b"".join(waiting) if len(waiting) > 1 else text
            waiting, size = [], 0
    if waiting:
        yield b"".join(waiting)


def _parsed(texts: Iterator[bytes]) -> Iterator[_Part]:
    """Each text parsed, in order, on as many threads as there are processors; the compiled parser releases the GIL."""
    workers = os.cpu_count() or 1
    with ThreadPoolExecutor(workers) as pool:
        waiting: deque[Future[_Part]] = deque()
        for text in texts:
            waiting.append(pool.submit(_parse, text))
            # a bounded queue: a file of gigabytes is not held in memory as text
            if len(waiting) > workers:
                yield waiting.popleft().result()
        for future in waiting:
            yield future.result()


def _whole_lines(pieces: Iterator[bytes], breaks: list[str]) -> Iterator[bytes]:
    """The pieces, cut at ends of lines; text after the last line end is half a frame and is dropped.

    breaks: receives the reason if that happens.
    """
    rest = b""
    try:
        for piece in pieces:
            cut = piece.rfind(b"\n") + 1
            if not cut and len(rest) + len(piece) > LONGEST_LINE:
                breaks.append(_ENDLESS)
                return
            if cut:
                yield b"".join((rest, memoryview(piece)[:cut]))
                rest = piece[cut:]
            else:
                rest += piece
    except (zlib.error, EOFError) as error:
        breaks.append(f"the compressed file breaks off here ({error})")
        return
    except LogError as error:
        breaks.append(str(error))
        return
    if rest.strip():
        breaks.append(_ENDLESS if len(rest) > LONGEST_LINE else "the file ends inside this line")


def _pieces(file: BinaryIO) -> Iterator[bytes]:
    """The file's bytes, decompressed if it is gzip."""
    first = file.read(PIECE)
    raw = chain([first], iter(lambda: file.read(PIECE), b""))
    return _inflated(raw) if first.startswith(_GZIP) else raw


def _inflated(raw: Iterator[bytes]) -> Iterator[bytes]:
    """Decompressed gzip members; EOFError or zlib.error only after all that could be read."""
    # not the gzip module: it raises at a cut-off end before it has given out the data that it could read
    member = zlib.decompressobj(_GZIP_FORMAT)
    taken = given = 0
    for block in raw:
        taken += len(block)
        while block:
            if member.eof:
                member = zlib.decompressobj(_GZIP_FORMAT)
            piece = member.decompress(block, CHUNK)
            given += len(piece)
            if given > max(INFLATION_FREE, INFLATION_LIMIT * taken):
                raise LogError(
                    f"{taken} compressed bytes hold more than {given >> 20} MiB of text, which no log does; "
                    "the rest of the file is not read"
                )
            yield piece
            block = member.unused_data if member.eof else member.unconsumed_tail
    if not member.eof:
        raise EOFError("end of file before the end of its data")
