"""Recordings as a source of the monitor: read in pieces, so that the first line comes at once, and followed while they grow."""

import os
import select
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

import numpy as np

from bus.user_error import UserError
from dbc.errors import LogError
from dbc.recordings.logfile import CHUNK, FrameTable, parse_candump
from dbc.recordings.reading import read_frames
from hil.monitor.source import Batch, Seen, signalled
from hil.monitor.target import STDIN, Target
from hil.shell.process import Stop

_LOOK_S = 0.1
"""Interval at which a growing file is checked [s]; inotify would not report changes on network file systems."""
_ROWS = 4096
_LOOKED_AT = 256
"""Bytes at the start of a file by which its format is recognised."""
_NAMED = 5
"""Damaged lines that are reported one by one; all are counted."""


class FollowError(UserError, ValueError):
    """A recording that cannot be followed while it grows."""


class Recordings:
    """Recordings one after the other; with `follow`, one candump log for as long as it grows."""

    def __init__(self, targets: Sequence[Target], *, follow: bool = False) -> None:
        """FollowError if there is more than one to follow."""
        if follow and len(targets) > 1:
            raise FollowError(f"--follow follows one file at a time, not {len(targets)}")
        self.names: tuple[str, ...] = ()
        self._targets, self._follow = targets, follow
        self._warnings: list[str] = []
        self._now_ns = 0

    def batches(self, stop: Stop, every_s: float) -> Iterator[Batch]:
        """As the protocol has it; LogError when a recording cannot be read."""
        for target in self._targets:
            for table in self._tables(target, stop, every_s):
                for start in range(0, len(table), _ROWS):
                    frames = rows(table, start, start + _ROWS)
                    self._now_ns = max(self._now_ns, frames[-1][1].at_ns)
                    yield Batch([seen for seen in frames if target.filters.passes(seen[1].can_id)], 0)
                if not len(table):
                    yield Batch([], 0)
                if signalled(stop):
                    return

    def _tables(self, target: Target, stop: Stop, every_s: float) -> Iterator[FrameTable]:
        assert target.path is not None
        if target.name != STDIN and not self._is_candump_log(target.path):
            table = read_frames(target.path)
            self._note_damage(target.name, table, 0)
            yield table
            return
        with _opened(target.path) as file:
            # candump logs alone are read in pieces: the other formats have tables or blocks that need the whole file
            yield from self._pieces(target.name, file, stop, every_s)

    def _is_candump_log(self, path: Path) -> bool:
        """Whether it can be read in pieces; FollowError if it has to be, and cannot."""
        with _opened(path) as file:
            start = file.read(_LOOKED_AT).lstrip()
        # an empty file may become a log: a recorder that has just been started
        if start[:1] == b"(" or (self._follow and not start):
            return True
        if self._follow:
            raise FollowError(f"{path}: only candump logs can be followed while they grow")
        return False

    def _pieces(self, name: str, file: BinaryIO, stop: Stop, every_s: float) -> Iterator[FrameTable]:
        """The log in pieces of whole lines, an empty one when nothing has come for a while."""
        rest, line, position, pipe = b"", 0, 0, not file.seekable()
        while True:
            if pipe and not select.select([file.fileno(), stop.fileno()], [], [], every_s)[0]:
                yield parse_candump(b"")
                continue
            if signalled(stop):
                return
            text = os.read(file.fileno(), CHUNK)
            if text:
                position += len(text)
                whole, rest = _cut(rest + text)
                if whole:
                    yield self._parsed(name, whole, line)
                    line += whole.count(b"\n")
            elif pipe or not self._follow:
                break
            # truncated by log rotation, as `tail -f` handles it
            elif os.fstat(file.fileno()).st_size < position:
                self._warnings.append(f"{name}: the file was cut off; reading it from its start")
                file.seek(0)
                rest, line, position = b"", 0, 0
            else:
                signalled(stop, _LOOK_S)
                yield parse_candump(b"")
        if rest:
            yield self._parsed(name, rest, line)

    def _parsed(self, name: str, text: bytes, line: int) -> FrameTable:
        table = parse_candump(text)
        self._note_damage(name, table, line)
        return table

    def _note_damage(self, name: str, table: FrameTable, before: int) -> None:
        """Keep a warning for each damaged line. before: number of lines of the file before this piece."""
        for damage in table.damaged[:_NAMED]:
            self._warnings.append(f"{name}: {replace(damage, at=before + damage.at)}")
        if table.damaged_count > _NAMED:
            self._warnings.append(f"{name}: {table.damaged_count - _NAMED} more damaged lines")

    def lost(self) -> dict[str, int]:
        """{}: nothing is lost, because a file waits for its reader."""
        return {}

    def warnings(self) -> list[str]:
        """Reports of damaged lines since the last call."""
        warnings, self._warnings = self._warnings, []
        return warnings

    def now_ns(self) -> int:
        """The newest stamp: the time of a recording is that of its last frame."""
        return self._now_ns


def rows(table: FrameTable, start: int, end: int) -> list[Seen]:
    """Rows of a table as frames with the name of their channel."""
    part = table.select(np.arange(start, min(end, len(table))))
    return [
        (table.channels[channel], frame)
        for channel, frame in zip(part.channel.tolist(), part.frames(), strict=True)
    ]


def _cut(text: bytes) -> tuple[bytes, bytes]:
    """Whole lines, and the beginning of the next."""
    end = text.rfind(b"\n") + 1
    return text[:end], text[end:]


def _opened(path: Path) -> BinaryIO:
    if str(path) == STDIN:
        return open(sys.stdin.fileno(), "rb", buffering=0, closefd=False)
    try:
        return path.open("rb", buffering=0)
    except OSError as error:
        raise LogError(f"{path}: cannot read the recording: {error.strerror or error}") from error
