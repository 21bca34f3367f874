"""Reads a recording of CAN frames, whatever its format, into one FrameTable or piece by piece.

candump logs, plain or gzip-compressed, and BLF are read by our own compiled parsers (`dbc.recordings.logfile`, `.blf`); ASC through
python-can; MF4 bus logging through asammdf, column by column. The content decides, not the suffix.

Error frames of BLF, ASC and MF4 carry no error bits, only that there was one. A cut or damaged place is reported
once, with its line or byte. Frames before it are kept; after a damaged line or a damaged place of a BLF also those
behind it.
"""

import re
from array import array
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO, Self, cast

import numpy as np

from bus.bounded_json import printable
from bus.frame import BRS, ERROR, ESI, EXTENDED, EXTENDED_MASK, FD, REMOTE, STANDARD_MASK
from dbc.errors import LogError
from dbc.lean import without_mf4
from dbc.recordings.blf import blf_pieces
from dbc.recordings.logfile import DAMAGE_SHOWN, Damage, FrameTable, candump_pieces, joined

Progress = Callable[[int, int], None]
FORMATS = "candump log, .gz of one, BLF, ASC or MF4"
_BINARY = (".blf", ".mf4", ".mdf")
_BLF, _MF4 = (b"LOGG",), (b"MDF ", b"UnFinMF ")
_ASC_LINE = re.compile(
    rb"\s*(\d+\.\d|//|date |base |begin |end |no |internal |previous |start of |$)", re.IGNORECASE
)
_ASC_STARTS = (b"date ", b"base ", b"// version", b"begin triggerblock")
LATEST_S = 9e9
"""Stamps beyond the year 2255 do not fit 64 bits of nanoseconds."""
PIECE_FRAMES = 1 << 16
"""Frames of a piece of an ASC."""
_REPORT_EVERY = 4096
_MICROSECOND = 1000


def read_frames(path: str | Path, progress: Progress | None = None) -> FrameTable:
    """Every frame of a recording, in the order of the file (MF4: of time).

    progress hears bytes read and bytes in all. LogError when the file cannot be opened, is none of FORMATS,
    or holds not one frame; a file that is damaged or cut off gives what can be read, and where it breaks.
    """
    return joined(read_pieces(path, progress))


def read_pieces(path: str | Path, progress: Progress | None = None) -> Iterator[FrameTable]:
    """A recording as `read_frames` reads it, piece by piece; the memory does not grow with the file, but for an MF4, which is one piece.

    Channels are numbered through; each table names those that are known by then. Some tables may be empty. LogError as
    there; that there is not one frame is known at the end.
    """
    path = Path(path)
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            start = file.read(64)
    except OSError as error:
        raise LogError(f"{path}: cannot read the recording: {error.strerror or error}") from error
    if size == 0:
        raise LogError(
            f"{path}: the recording is empty (0 bytes): was the bus silent, or its recorder killed at once?"
        )
    reader = _reader_of(path, start)
    misnamed = reader is candump_pieces and path.suffix.lower() in _BINARY
    if misnamed and not start.isascii():
        raise _no_beginning(path)
    frames, first = 0, None
    try:
        for table in reader(path, progress):
            frames += len(table)
            first = first or next(iter(table.damaged), None)
            yield table
    except LogError as error:
        if misnamed:
            raise _no_beginning(path) from error
        raise
    if not frames:
        raise LogError(f"{path}: the recording holds not one frame{f' ({first})' if first else ''}")


def _no_beginning(path: Path) -> LogError:
    kind = path.suffix[1:].upper()
    return LogError(f"{path}: does not begin as a {kind} does: damaged, encrypted, or of another kind?")


def _reader_of(path: Path, start: bytes) -> Callable[[Path, Progress | None], Iterator[FrameTable]]:
    if start.startswith(_BLF):
        return blf_pieces
    if start.startswith(_MF4):
        return _mf4_pieces
    if path.suffix.lower() == ".asc" or start.lstrip().lower().startswith(_ASC_STARTS):
        return _asc_pieces
    return candump_pieces


def _mf4_pieces(path: Path, progress: Progress | None) -> Iterator[FrameTable]:
    from dbc.recordings.mf4 import read_mf4  # asammdf takes a second to load

    # one piece: the groups of an MF4 are merged by time, and nothing says that a group is in the order of time
    yield read_mf4(path, progress)


class _Rows:
    """Collects python-can's messages as columns."""

    def __init__(self) -> None:
        self._time_ns, self._can_id = array("q"), array("I")
        self._length, self._flags, self._channel = array("B"), array("B"), array("B")
        self._data: list[bytes] = []
        self._channels: dict[Any, int] = {}
        self._shown = 0  # damaged places that were given out
        self._damaged: list[Damage] = []
        self._damaged_count = 0

    def add(self, message: Any) -> None:
        """One python-can message; ValueError if it is no whole frame."""
        remote, error, data = message.is_remote_frame, message.is_error_frame, bytes(message.data)
        if not remote and not error and message.dlc != len(data):
            raise ValueError(f"{len(data)} bytes of data where {message.dlc} are announced")
        if not 0 <= message.arbitration_id <= (EXTENDED_MASK if message.is_extended_id else STANDARD_MASK):
            raise ValueError(f"identifier {message.arbitration_id:X} has more bits than a frame's")
        if not abs(message.timestamp) < LATEST_S:
            raise ValueError(f"time stamp {message.timestamp:g} s")
        limit = 64 if message.is_fd else 8
        if message.dlc > limit:
            raise ValueError(f"{message.dlc} bytes of data, more than a frame holds ({limit})")
        number = self._channels.setdefault(message.channel, len(self._channels))
        if number > 255:
            raise LogError("more than 256 different channels")
        extended = EXTENDED if message.is_extended_id and not error else 0
        # CAN FD has no remote frames: one that claims to be both is read as a remote frame
        fd = message.is_fd and not remote
        flags = FD | BRS * message.bitrate_switch | ESI * message.error_state_indicator if fd else 0
        # python-can gives float seconds, which near today's date resolve 0.24 µs: rounded to the microsecond
        self._time_ns.append(round(message.timestamp * 1e6) * _MICROSECOND)
        self._can_id.append(message.arbitration_id | extended | REMOTE * remote | ERROR * error)
        # a remote frame has no data, but a length
        self._length.append(message.dlc if remote else len(data))
        self._flags.append(flags)
        self._channel.append(number)
        self._data.append(data)

    def add_damage(self, damage: Damage) -> None:
        """Note a place that could not be read."""
        if self._shown + len(self._damaged) < DAMAGE_SHOWN:
            self._damaged.append(damage)
        self._damaged_count += 1

    def __len__(self) -> int:
        return len(self._data)

    def take(self) -> FrameTable:
        """What was added since the last time; channels are numbered on."""
        width = 64 if any(flags & FD for flags in self._flags) else 8
        joined = b"".join(data.ljust(width, b"\0") for data in self._data)
        table = FrameTable(
            time_ns=np.array(self._time_ns, np.int64),
            can_id=np.array(self._can_id, np.uint32),
            length=np.array(self._length, np.uint8),
            flags=np.array(self._flags, np.uint8),
            data=np.frombuffer(joined, np.uint8).reshape(len(self._data), width),
            channel=np.array(self._channel, np.uint8),
            channels=tuple(channel_name(channel) for channel in self._channels),
            damaged=tuple(self._damaged),
            damaged_count=self._damaged_count,
        )
        self._shown += len(self._damaged)
        self._damaged, self._damaged_count = [], 0
        self._time_ns, self._can_id = array("q"), array("I")
        self._length, self._flags, self._channel = array("B"), array("B"), array("B")
        self._data = []
        return table


def channel_name(channel: int | str | None) -> str:
    """What a channel is called that the format only numbers (from 0): can0, can1, ..."""
    if channel is None:
        return "can"
    return f"can{channel}" if isinstance(channel, int) else printable(channel)


class _NumberedLines:
    """A text file for python-can's reader that knows which line it is at, and can go on after a bad one.

    cut: whether the file ends inside a line; that line is left out, as half a number is still a number.
    strange: numbers of lines that are none of the format's, which python-can passes over.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._resumed = False
        self.number = 0
        self.cut = False
        self.strange: list[int] = []

    def resume(self) -> None:
        """The reader will look for a header again: the next line says that there is none."""
        self._resumed = True

    def close(self) -> None:
        """Does nothing: the file belongs to its opener, and the reader closes what it was given."""

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> str:
        if self._resumed:
            self._resumed = False
            return "internal events logged\n"
        line = self._file.readline()
        if not line:
            raise StopIteration
        self.number += 1
        self.cut = not line.endswith(b"\n") and not line.lower().startswith(b"end triggerblock")
        if self.cut:
            raise StopIteration
        if not _ASC_LINE.match(line) or b"\0" in line:
            self.strange.append(self.number)
        return line.decode("utf-8", "replace")


def _asc_pieces(path: Path, progress: Progress | None) -> Iterator[FrameTable]:
    with without_mf4():
        from can.io.asc import ASCReader

    size, rows = path.stat().st_size, _Rows()
    with path.open("rb") as file:
        lines = _NumberedLines(file)
        reader = ASCReader(cast(Any, lines), relative_timestamp=False)
        messages: Iterator[Any] = iter(reader)
        while True:
            try:
                message = next(messages)
                rows.add(message)
            except StopIteration:
                break
            except LogError:
                raise
            except Exception as error:  # python-can's reader fails on damaged lines in many ways
                rows.add_damage(Damage(lines.number, f"not a frame: {error}"))
                lines.resume()
                messages = iter(reader)
            if progress is not None and lines.number % _REPORT_EVERY == 0:
                progress(file.tell(), size)
            if len(rows) >= PIECE_FRAMES:
                yield rows.take()
        for number in lines.strange:
            rows.add_damage(
                Damage(number, "no time stamp and no word of the format at its start, or zero bytes in it")
            )
        if lines.cut:
            rows.add_damage(Damage(lines.number, "the file ends inside this line", at_end=True))
    yield rows.take()
