"""The writers of the recording formats: each file is appended to batch by batch, and readable after each batch.

A writer hands every batch to the kernel before `write` returns, so that a killed process loses no written frame.
"""

import datetime
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from bus.frame import BRS, ERROR, ESI, EXTENDED, EXTENDED_MASK, FD, REMOTE, Frame
from bus.hub.packet import FD_LENGTHS
from bus.user_error import UserError
from dbc.recordings.writer import candump_line
from hil.recording.new_file import NewFile
from hil.recording.ring import Records, frames_of

SUFFIXES = (".log", ".blf", ".asc", ".mf4")


class RecordingError(UserError, ValueError):
    """A recording cannot be written; the message names the file and the cause."""


class Writer(Protocol):
    """One file of a recording."""

    def write(self, records: Records) -> None:
        """Append frames, in the order given; they are readable when this returns."""

    def size(self) -> int:
        """Bytes in the file."""

    def close(self) -> None:
        """Finish the file; a second call does nothing."""


def open_writer(path: Path, channels: Sequence[str]) -> Writer:
    """A new file in the format of its suffix. channels: names of the buses, in the order of their numbers.

    RecordingError if the format is unknown, the file exists, or cannot be made.
    """
    check_suffix(path)
    try:
        match path.suffix.lower():
            case ".blf":
                from hil.recording.blf import BlfWriter

                return BlfWriter(path)
            case ".mf4":
                from hil.recording.mf4 import Mf4Writer  # asammdf takes a second to load

                return Mf4Writer(path, len(channels))
            case ".asc":
                return AscWriter(path)
        return CandumpRecords(path, channels)
    except FileExistsError:
        raise RecordingError(
            f"{path}: exists, and a recording never replaces one; name a new file or move it away"
        ) from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written: {error.strerror or error}") from error


def check_suffix(path: Path) -> None:
    """RecordingError unless the suffix names a format."""
    if path.suffix.lower() not in SUFFIXES:
        raise RecordingError(f"{path}: the suffix names the format, one of {', '.join(SUFFIXES)}")


_STAMP = len("(0000000000.000000)")


class CandumpRecords:
    """A candump log (`candump -L`)."""

    def __init__(self, path: Path, channels: Sequence[str]) -> None:
        self._file = NewFile(path)
        self._channels = tuple(channels)
        self._heads: dict[
            tuple[int, int, int], str
        ] = {}  # text between stamp and data, by (can_id, flags, channel): the same for every frame of an identifier

    def write(self, records: Records) -> None:
        """One line per frame, as `dbc.recordings.writer.candump_line` makes them one by one."""
        if len(records):
            self._file.append("".join(self._lines(records)).encode("ascii"))

    def _lines(self, records: Records) -> list[str]:
        # one conversion to hexadecimal for the whole batch; each line takes its slice
        digits, width = records["data"].tobytes().hex().upper(), 2 * records["data"].shape[1]
        columns = (
            records["at_ns"] // 1000,
            records["can_id"],
            records["length"],
            records["flags"],
            records["channel"],
        )
        heads = self._heads
        lines = []
        for row, (at_us, *kind, channel) in enumerate(
            zip(*(column.tolist() for column in columns), strict=True)
        ):
            can_id, length, flags = kind
            if (head := heads.get((can_id, flags, channel))) is None:
                empty = Frame(can_id & ~REMOTE, b"", 0, flags)
                head = heads[can_id, flags, channel] = candump_line(empty, self._channels[channel])[_STAMP:]
            data = f"R{length or ''}" if can_id & REMOTE else digits[row * width : row * width + 2 * length]
            lines.append(f"({at_us // 1_000_000:010d}.{at_us % 1_000_000:06d}){head}{data}\n")
        return lines

    def size(self) -> int:
        """Bytes in the file."""
        return self._file.size

    def close(self) -> None:
        """Close the file."""
        self._file.close()


_DAYS = ("Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun")
_MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
_CODES = {length: code for code, length in enumerate(sorted(FD_LENGTHS))}


class AscWriter:
    """An ASC text log. Its date is local time, its channels are numbered from 1, its error frames carry no bits."""

    def __init__(self, path: Path) -> None:
        self._file = NewFile(path)
        self._start_ns: int | None = None

    def write(self, records: Records) -> None:
        """One line per frame; the first batch brings the header."""
        frames = frames_of(records)
        if not frames:
            return
        text = []
        if self._start_ns is None:
            self._start_ns = frames[0][1].at_ns // 1_000_000 * 1_000_000
            text.append(_asc_header(self._start_ns))
        start_ns = self._start_ns
        text += [asc_line(frame, channel + 1, start_ns) for channel, frame in frames]
        self._file.append("".join(text).encode("ascii"))

    def size(self) -> int:
        """Bytes in the file."""
        return self._file.size

    def close(self) -> None:
        """Write the last line and close the file."""
        if self._start_ns is not None:
            # readers accept a file without it: after a kill it is missing
            self._file.append(b"End TriggerBlock\n")
            self._start_ns = None
        self._file.close()


def _asc_header(start_ns: int) -> str:
    at = datetime.datetime.fromtimestamp(start_ns // 1_000_000 / 1000, datetime.UTC).astimezone()
    date = (
        f"{_DAYS[at.weekday()]} {_MONTHS[at.month - 1]} {at.day:02d} "
        f"{at:%H:%M:%S}.{at.microsecond // 1000:03d} {at.year}"
    )
    return (
        f"date {date}\nbase hex  timestamps absolute\ninternal events logged\n"
        f"Begin Triggerblock {date}\n   0.000000 Start of measurement\n"
    )


def asc_line(frame: Frame, channel: int, start_ns: int) -> str:
    """One frame as a line, its stamp relative to the start of the file."""
    can_id, data, at_ns, flags = frame
    microseconds = (at_ns - start_ns) // 1000
    stamp = f"{microseconds // 1_000_000:4d}.{microseconds % 1_000_000:06d}"
    if can_id & ERROR:
        return f"{stamp} {channel}  ErrorFrame\n"
    name = f"{can_id & EXTENDED_MASK:X}{'x' if can_id & EXTENDED else ''}"
    content = data.hex(" ").upper()
    if flags & FD:
        switched, passive = int(bool(flags & BRS)), int(bool(flags & ESI))
        word = 1 << 12 | switched << 13 | passive << 14
        return (
            f"{stamp} CANFD {channel:3d} Rx   {name:>8}  {'':>32} {switched} {passive} {_CODES[len(data)]:x} "
            f"{len(data):2d} {content} {0:8d} {0:4d} {word:8X} {0:8d} {0:8d} {0:8d} {0:8d} {0:8d}\n"
        )
    if can_id & REMOTE:
        return f"{stamp} {channel}  {name:<15} Rx   r {len(data):x}\n"
    return f"{stamp} {channel}  {name:<15} Rx   d {len(data):x} {content}\n"
