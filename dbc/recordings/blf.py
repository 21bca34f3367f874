"""Reads BLF, Vector's binary log, through python-can's reader, and continues behind damaged places.

A BLF is a header and containers of deflated objects; an object may continue in the next container. python-can's
reader ends at the first unreadable place; here it restarts at the next container, with the first object that
begins in there.
"""

import mmap
import os
import re
import struct
import zlib
from collections.abc import Iterator
from typing import Any, BinaryIO, Final, cast

from dbc.lean import without_mf4
from dbc.recordings.logfile import Damage

_OBJECT: Final = struct.Struct("<4sHHLL")  # signature, length of the header, its version, length, kind
_CONTAINER: Final = struct.Struct("<H6xL4x")  # compression, length of the content
_CONTAINER_KIND, _PLAIN, _DEFLATED = 10, 0, 2
CONTAINER_LIMIT: Final = 64 << 20
"""Most bytes that a container may hold; loggers write 128 KiB, some a few MiB."""
_CONTAINER_BEGINS: Final = re.compile(rb"LOBJ\x10\x00\x01\x00.{4}\x0a\x00\x00\x00", re.DOTALL)


def read_blf(file: BinaryIO) -> Iterator[Any]:
    """python-can's messages in the order of the file, and between them a Damage for each place that cannot be read."""
    with without_mf4():
        from can.io.blf import BLFParseError, BLFReader

    with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        start = int.from_bytes(content[4:8], "little")
        header = content[:start]
        source = _Source(file, header, start)
        broken: Damage | None = None
        last_s: float | None = None
        while True:
            try:
                for message in BLFReader(cast(Any, source)):
                    if broken is not None:
                        yield _skipped(broken, start, last_s, message.timestamp)
                        broken = None
                    last_s = message.timestamp
                    yield message
                at, whole = _object_before(content, start, len(content))
                damage = Damage(at, "the file breaks off inside an object", "byte", at_end=True)
            except (BLFParseError, struct.error, zlib.error, ValueError) as error:
                at, whole = _object_before(content, start, file.tell())[0], False
                damage = Damage(at, f"not readable from here ({error or 'no object begins'})", "byte")
            if whole and broken is None:
                return
            broken = broken or damage
            # +4: past the signature of the object at `at`, so that the search makes progress
            for found in _CONTAINER_BEGINS.finditer(content, at + 4):
                if resumed := _from_first_object(content, found.start()):
                    start = found.start()
                    break
            else:
                yield broken
                return
            source = _Source(file, header + resumed, _behind(content, start))


# python-can takes a file object and no position; this gives it the header, then the rest from any place.
class _Source:
    """What python-can's reader takes for a file: bytes that are given, then those of the file from `start` on."""

    def __init__(self, file: BinaryIO, given: bytes, start: int) -> None:
        self._file, self._given = file, given
        self._in_container = False  # whether the next piece is the content of a container
        self._size = file.seek(0, os.SEEK_END)
        file.seek(start)

    def read(self, size: int) -> bytes:
        """At most `size` bytes; none where a damaged length makes it negative. The content of a container comes inflated."""
        size = max(size, 0)
        piece, self._given = self._given[:size], self._given[size:]
        # Not more than the file still has: Python makes room for all that is asked for, and a damaged length asks for 4 GiB.
        piece += self._file.read(min(size - len(piece), max(self._size - self._file.tell(), 0)))
        # python-can reads an object in two steps, its head and the rest
        begins, self._in_container = self._in_container, _is_container(piece)
        return _inflated(piece) if begins else piece

    def close(self) -> None:
        """The reader has done with it; the file belongs to whoever opened it."""


def _is_container(piece: bytes) -> bool:
    return (
        len(piece) == _OBJECT.size
        and piece.startswith(b"LOBJ")
        and _OBJECT.unpack(piece)[4] == _CONTAINER_KIND
    )


def _inflated(body: bytes) -> bytes:
    """The content of a container without compression; of one that is cut off, what there is of it. zlib.error, ValueError.

    python-can inflates without a bound, a thousand times as many bytes as were in the file.
    """
    if len(body) < _CONTAINER.size or _CONTAINER.unpack_from(body)[0] != _DEFLATED:
        return body
    stream = zlib.decompressobj()
    objects = stream.decompress(body[_CONTAINER.size :], CONTAINER_LIMIT)
    if stream.unconsumed_tail:
        raise ValueError(f"a container holds more than {CONTAINER_LIMIT >> 20} MiB")
    return _CONTAINER.pack(_PLAIN, len(objects)) + objects


def _object_before(content: mmap.mmap, at: int, position: int) -> tuple[int, bool]:
    """Begin of the last object that a reader, which started at the object `at`, had read when it came to `position`; whether it is whole."""
    while at + _OBJECT.size <= len(content):
        signature, _, _, length, _ = _OBJECT.unpack_from(content, at)
        if signature != b"LOBJ" or length < _OBJECT.size or at + length > len(content):
            return at, False
        if _behind(content, at) >= position:
            return at, True
        at = _behind(content, at)
    return at, at >= len(content)


def _behind(content: mmap.mmap, at: int) -> int:
    """Where python-can looks for the object that follows the one at `at`."""
    length: int = _OBJECT.unpack_from(content, at)[3]
    # not padded to 4: python-can skips length % 4 bytes, and this must agree with it
    return at + length + length % 4


def _from_first_object(content: mmap.mmap, at: int) -> bytes:
    """The container at `at`, inflated, from the first object that begins in it; empty if there is none or it is damaged."""
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
    if first < 0:
        return b""
    objects = objects[first:]
    size = _OBJECT.size + _CONTAINER.size + len(objects)
    head = _OBJECT.pack(b"LOBJ", _OBJECT.size, 1, size, _CONTAINER_KIND) + _CONTAINER.pack(
        _PLAIN, len(objects)
    )
    return head + objects + bytes(size % 4)


def _skipped(broken: Damage, end: int, before_s: float | None, behind_s: float) -> Damage:
    """The message about a damaged place behind which frames follow."""
    lost = (
        "before the first frame"
        if before_s is None
        else f"{behind_s - before_s:.3f} s between the frames around it"
    )
    return Damage(broken.at, f"{broken.reason}, {end - broken.at} bytes skipped, {lost}", "byte")
