"""Reads BLF, Vector's binary log, piece by piece, and continues behind damaged places.

A BLF is a header and containers of deflated objects; an object may continue in the next container. Containers are
inflated ahead on all processors, their objects parsed by a compiled loop (`dbc.recordings.blf_objects`). Behind a
damaged place it goes on with the first object that begins in the next container. What an undamaged file holds is what
python-can's reader gives, which is the reference of the tests.
"""

import io
import mmap
import os
import re
import struct
import zlib
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import chain
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from isal import isal_zlib
from isal.isal_zlib import IsalError
from numpy.typing import NDArray

from dbc.errors import LogError
from dbc.lean import without_mf4
from dbc.recordings import blf_objects
from dbc.recordings.logfile import DAMAGE_SHOWN, Damage, FrameTable

_OBJECT: Final = struct.Struct("<4sHHLL")  # signature, length of the header, its version, length, kind
_CONTAINER: Final = struct.Struct("<H6xL4x")  # compression, length of the content
_CONTAINER_KIND, _PLAIN, _DEFLATED = 10, 0, 2
CONTAINER_LIMIT: Final = 64 << 20
"""Most bytes that a container may hold; loggers write 128 KiB, some a few MiB."""
_CONTAINER_BEGINS: Final = re.compile(rb"LOBJ\x10\x00\x01\x00.{4}\x0a\x00\x00\x00", re.DOTALL)
PIECE_FRAMES = 1 << 16
"""Frames of a piece."""
_HEADER = 72  # bytes of the file's header
_AHEAD = 8  # containers that are inflated while one is parsed


class _Unreadable(Exception):
    """An object of the file cannot be read; with its place and the reason."""

    def __init__(self, at: int, reason: str) -> None:
        super().__init__(reason)
        self.at = at


class _Rows:
    """Collects frames as columns, and damage, until they are taken as a piece."""

    def __init__(self) -> None:
        self.start_s = 0.0  # stamp of the file's begin [s], which the objects' stamps count from
        self._channels = np.empty(blf_objects.CHANNELS, np.int64)
        self._known = 0
        self._width = 8
        self._shown = 0  # damaged places that were given out
        self._damaged: list[Damage] = []
        self._damaged_count = 0
        self._full: list[FrameTable] = []
        self._begin()

    def _begin(self) -> None:
        kinds = (np.int64, np.uint32, np.uint8, np.uint8, np.uint8, np.uint8)
        size = PIECE_FRAMES
        self._columns = tuple(
            np.zeros((size, self._width) if place == 4 else size, kind) for place, kind in enumerate(kinds)
        )
        self._row = 0

    def parse(self, data: bytes, position: int) -> "_Parsed":
        """Add the frames of the objects in `data`; position: of the file, for the damage of bad frames. LogError for too many channels."""
        text, at = np.frombuffer(data, np.uint8), 0
        first_s, last_s, bad, bad_count = None, 0.0, list[Damage](), 0
        while True:
            stamps, rows_of_bad = np.array([np.nan, np.nan]), np.empty((DAMAGE_SHOWN, 4), np.int64)
            how, at, self._row, self._known, broken = blf_objects.parse(
                text, at, self.start_s, self._columns, self._row, self._channels, self._known, stamps, rows_of_bad
            )  # fmt: skip
            if not np.isnan(stamps[0]):  # stamps of objects are integers, never NaN
                first_s = float(stamps[0]) if first_s is None else first_s
                last_s = float(stamps[1])
            bad += [_bad_frame(row, position) for row in rows_of_bad[:broken]]
            bad_count += broken
            if how == blf_objects.TOO_MANY:
                raise LogError(f"more than {blf_objects.CHANNELS} different channels")
            if how not in (blf_objects.FULL, blf_objects.TOO_NARROW):
                break
            self._full.append(self.take())
            self._width = 64 if how == blf_objects.TOO_NARROW else self._width
            self._begin()
        return _Parsed(data[at:], how == blf_objects.NO_OBJECT, first_s, last_s, bad, bad_count)

    def add_damage(self, damage: Damage) -> None:
        """Note a place that could not be read."""
        if self._shown + len(self._damaged) < DAMAGE_SHOWN:
            self._damaged.append(damage)
        self._damaged_count += 1

    def add_bad(self, parsed: "_Parsed") -> None:
        """Note the frames of a container that are none."""
        for damage in parsed.bad:
            self.add_damage(damage)
        self._damaged_count += parsed.bad_count - len(parsed.bad)

    def full(self) -> list[FrameTable]:
        """The pieces that are full."""
        full, self._full = self._full, []
        return full

    def take(self) -> FrameTable:
        """The frames since the last full piece, and the damage."""
        time_ns, can_id, length, flags, data, channel = (column[: self._row] for column in self._columns)
        table = FrameTable(
            time_ns=time_ns,
            can_id=can_id,
            length=length,
            flags=flags,
            data=data,
            channel=channel,
            channels=tuple(f"can{number}" for number in self._channels[: self._known].tolist()),
            damaged=tuple(self._damaged),
            damaged_count=self._damaged_count,
        )
        self._shown += len(self._damaged)
        self._damaged, self._damaged_count = [], 0
        return table


class _Parsed(NamedTuple):
    """What the objects of a container gave."""

    tail: bytes  # an object that continues in the next container
    lost: bool  # whether no object began where one had to
    first_s: float | None  # stamp of the first frame, also of a bad one; None: there is no frame
    last_s: float
    bad: list[Damage]  # the first frames that are none
    bad_count: int


def _bad_frame(row: NDArray[np.int64], position: int) -> Damage:
    why, first, second = row[:3].tolist()
    reason = {
        blf_objects.OTHER_LENGTH: f"{first} bytes of data where {second} are announced",
        blf_objects.WIDE_IDENTIFIER: f"identifier {first:X} has more bits than a frame's",
        blf_objects.STAMP: f"time stamp {row[3:].view(np.float64)[0]:g} s",
        blf_objects.TOO_LONG: f"{first} bytes of data, more than a frame holds ({second})",
    }[why]
    return Damage(position, f"in what ends here, not a frame: {reason}; skipped", "byte")


def blf_pieces(path: Path, progress: Callable[[int, int], None] | None = None) -> Iterator[FrameTable]:
    """The frames of a BLF in the order of the file, piece by piece, one piece at least; each with the damage found on the way.

    LogError for more than 256 channels.
    """
    rows = _Rows()
    with (
        path.open("rb") as file,
        mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content,
        ThreadPoolExecutor(os.cpu_count() or 1) as pool,
    ):
        for end in _read(content, pool, rows):
            if progress is not None:
                progress(end, len(content))
            yield from rows.full()
    # damage in a container ends it after pieces were filled
    yield from rows.full()
    yield rows.take()


def _read(content: mmap.mmap, pool: ThreadPoolExecutor, rows: _Rows) -> Iterator[int]:
    """Add all frames and all damage to `rows`; gives the position in the file after each container."""
    with without_mf4():
        from can.io.blf import BLFParseError, BLFReader

    start = int.from_bytes(content[4:8], "little")
    try:
        # the fields of the header have 72 bytes, whatever length it gives itself
        rows.start_s = BLFReader(io.BytesIO(content[: max(start, _HEADER)])).start_timestamp
    except (BLFParseError, struct.error, ValueError) as error:
        rows.add_damage(Damage(start, f"not readable from here ({error or 'no object begins'})", "byte"))
        return
    start = max(start, _HEADER)
    at, given = start, b""  # where to go on, and the objects before it
    broken: Damage | None = None
    last_s: float | None = None
    while True:
        tail, first = b"", [(start, at, given)] if given else []
        try:
            for begin, end, objects in chain(first, _contents(content, at, pool)):
                parsed = rows.parse(tail + objects, min(end, len(content)))
                if parsed.first_s is not None:
                    if broken is not None:
                        rows.add_damage(_skipped(broken, start, last_s, parsed.first_s))
                        broken = None
                    last_s = parsed.last_s
                rows.add_bad(parsed)
                if parsed.lost:
                    raise _Unreadable(begin, "Could not find next object")
                tail = parsed.tail
                yield min(end, len(content))
            position, whole = _object_before(content, start)
            if whole and broken is None:
                return
            damage = Damage(position, "the file breaks off inside an object", "byte", at_end=True)
        except _Unreadable as error:
            position = error.at
            damage = Damage(position, f"not readable from here ({error})", "byte")
        broken = broken or damage
        # +4: past the signature of the object there, so that the search makes progress
        for found in _CONTAINER_BEGINS.finditer(content, position + 4):
            if given := _from_first_object(content, found.start()):
                start, at = found.start(), _behind(content, found.start())
                break
        else:
            rows.add_damage(broken)
            return


def _contents(content: mmap.mmap, at: int, pool: ThreadPoolExecutor) -> Iterator[tuple[int, int, bytes]]:
    """Begin, end and inflated content of each container from the object at `at` on, in order; _Unreadable where that ends."""
    objects = _objects(content, at)
    ahead: deque[tuple[int, int, Future[bytes]]] = deque()
    failed: _Unreadable | None = None
    try:
        while True:
            while failed is None and len(ahead) < _AHEAD:
                try:
                    begin, end, length = next(objects)
                except StopIteration:
                    break
                except _Unreadable as error:
                    failed = error
                else:
                    body = content[begin + _OBJECT.size : begin + length]
                    ahead.append((begin, end, pool.submit(_inflated, body)))
            if not ahead:
                break
            begin, end, inflated = ahead.popleft()
            try:
                yield begin, end, inflated.result()
            except (struct.error, zlib.error, ValueError) as error:
                raise _Unreadable(begin, str(error)) from None
    finally:
        for _, _, inflated in ahead:
            inflated.cancel()
    if failed is not None:
        raise failed


def _objects(content: mmap.mmap, at: int) -> Iterator[tuple[int, int, int]]:
    """Begin of each container from the object at `at` on, begin of the object behind it, and its length, which may reach beyond the file."""
    while at < len(content):
        try:
            signature, _, _, length, kind = _OBJECT.unpack(content[at : at + _OBJECT.size])
        except struct.error as error:
            raise _Unreadable(at, str(error)) from None
        if signature != b"LOBJ" or length < _OBJECT.size:
            raise _Unreadable(at, "no object begins")
        if kind == _CONTAINER_KIND:
            yield at, _behind(content, at), length
        at = _behind(content, at)


def _inflated(body: bytes) -> bytes:
    """The objects of a container; of one that is cut off, what there is of them. struct.error, zlib.error, ValueError."""
    method, _ = _CONTAINER.unpack_from(body)
    if method == _PLAIN:
        return body[_CONTAINER.size :]
    if method != _DEFLATED:
        return b""  # a method that nobody knows: passed over, as python-can does
    deflated = body[_CONTAINER.size :]
    try:
        fast = isal_zlib.decompressobj()
        objects = fast.decompress(deflated, CONTAINER_LIMIT)
        if fast.eof:
            return objects
    except IsalError:  # type: ignore[misc]  # the stubs give an instance for the class
        pass
    # Cut off, damaged or too long: zlib gives all there is of it, and its reason.
    stream = zlib.decompressobj()
    objects = stream.decompress(deflated, CONTAINER_LIMIT)
    if stream.unconsumed_tail:
        raise ValueError(f"a container holds more than {CONTAINER_LIMIT >> 20} MiB")
    return objects


def _object_before(content: mmap.mmap, at: int) -> tuple[int, bool]:
    """Begin of the last object from the one at `at` on; whether it lies in the file as a whole."""
    last = at
    while at + _OBJECT.size <= len(content):
        signature, _, _, length, _ = _OBJECT.unpack_from(content, at)
        if signature != b"LOBJ" or length < _OBJECT.size or at + length > len(content):
            return at, False
        last, at = at, _behind(content, at)
    return (last, True) if at >= len(content) else (at, False)


def _behind(content: mmap.mmap, at: int) -> int:
    """Where python-can looks for the object that follows the one at `at`."""
    length: int = _OBJECT.unpack_from(content, at)[3]
    # not padded to 4: python-can skips length % 4 bytes, and this must agree with it
    return at + length + length % 4


def _from_first_object(content: mmap.mmap, at: int) -> bytes:
    """The objects of the container at `at` from the first that begins in it; empty if there is none or it is damaged."""
    length = _OBJECT.unpack_from(content, at)[3]
    body = content[at + _OBJECT.size : at + length]
    objects = body[_CONTAINER.size :]
    if body[:2] == _DEFLATED.to_bytes(2, "little"):
        try:
            # a decompressobj returns what it has, also when the stream is cut off
            objects = zlib.decompressobj().decompress(objects, CONTAINER_LIMIT)
        except zlib.error:
            return b""
    first = objects.find(b"LOBJ")
    return objects[first:] if first >= 0 else b""


def _skipped(broken: Damage, end: int, before_s: float | None, behind_s: float) -> Damage:
    """The message about a damaged place behind which frames follow."""
    lost = (
        "before the first frame"
        if before_s is None
        else f"{behind_s - before_s:.3f} s between the frames around it"
    )
    return Damage(broken.at, f"{broken.reason}, {end - broken.at} bytes skipped, {lost}", "byte")
