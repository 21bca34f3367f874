"""The files of one recording, for the writing process: one file, or a new one by size or time."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hil.recording.formats import Writer, open_writer
from hil.recording.ring import Records

MICROSECOND_NS = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """The options of a recording."""

    path: Path
    channels: tuple[str, ...]  # names of the buses in the order of their numbers
    offset_ns: int = 0  # from the buses' clock to the file's
    flush_s: float = 0.2  # longest time that a frame waits to be written [s]
    rotate_bytes: int = 0  # size at which a new file begins; 0: never
    rotate_ns: int = 0  # duration after which a new file begins; 0: never


class RecordingFiles:
    """Writes batches of the ring's records into the files.

    By size a new file begins with the first batch after `rotate_bytes`, by time with the first frame that is `rotate_ns`
    or more after the first of its file.
    """

    def __init__(self, plan: Plan) -> None:
        """RecordingError if the first file cannot be made."""
        self._plan = plan
        self._rotates = bool(plan.rotate_bytes or plan.rotate_ns)
        self._first_ns: int | None = None
        self.paths: list[Path] = []
        self.frames = 0
        self._writer = self._next()

    def _next(self) -> Writer:
        path = numbered(self._plan.path, len(self.paths) + 1) if self._rotates else self._plan.path
        writer = open_writer(path, self._plan.channels)
        self.paths.append(path)
        self._first_ns = None
        return writer

    def write(self, records: Records) -> None:
        """Append a batch; it is in the file when this returns."""
        if not len(records):
            return
        # several buses arrive one after the other: sorted by stamp within the batch
        records = records[np.argsort(records["at_ns"], kind="stable")]
        # whole microseconds: the finest that all formats hold, so that every format gives the same stamps
        records["at_ns"] = (records["at_ns"] + self._plan.offset_ns) // MICROSECOND_NS * MICROSECOND_NS
        if self._plan.rotate_bytes and self._writer.size() >= self._plan.rotate_bytes:
            self._rotate()
        while len(records):
            if self._first_ns is None:
                self._first_ns = int(records["at_ns"][0])
            count = len(records)
            if self._plan.rotate_ns:
                count = int(np.searchsorted(records["at_ns"], self._first_ns + self._plan.rotate_ns))
            self._writer.write(records[:count])
            self.frames += count
            records = records[count:]
            if len(records):
                self._rotate()

    def _rotate(self) -> None:
        self._writer.close()
        self._writer = self._next()

    def close(self) -> None:
        """Finish the last file."""
        self._writer.close()


def numbered(path: Path, number: int) -> Path:
    """The name of the n-th file: drive.blf becomes drive-001.blf."""
    return path.with_stem(f"{path.stem}-{number:03d}")


def files_of(plan: Plan) -> tuple[Path, ...]:
    """The existing files of a recording, for the report on a writer that was killed."""
    if not (plan.rotate_bytes or plan.rotate_ns):
        return (plan.path,) if plan.path.exists() else ()
    candidates = (numbered(plan.path, number) for number in itertools.count(1))
    return tuple(itertools.takewhile(Path.exists, candidates))


def names_of(paths: Sequence[Path]) -> str:
    """The files in a line."""
    return str(paths[0]) if len(paths) == 1 else f"{paths[0]} .. {paths[-1].name} ({len(paths)} files)"
