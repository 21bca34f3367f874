"""Writes BLF, Vector's binary log, for the recorder; the file is valid after every batch.

Objects and containers as python-can's reader expects them (can/io/blf.py, after Toby Lorenz' Vector BLF): a header
of 144 bytes, then containers of at most 128 KiB of deflated objects. python-can's own writer writes date and
counts only when it is stopped, so the file of a killed process has no date; here the header is rewritten after each batch.
"""

import datetime
import struct
import zlib
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bus.frame import BRS, ERROR, ESI, EXTENDED, EXTENDED_MASK, FD, REMOTE
from bus.hub.packet import FD_LENGTHS
from hil.recording.new_file import NewFile
from hil.recording.ring import Records

CONTAINER_BYTES = 1 << 17
_FILE_HEADER = struct.Struct("<4sLBBBBBBBBQQLL8H8H64x")
_APPLICATION = (5, 0, 0, 0, 2, 6, 8, 1)  # as python-can: application and format versions
_CONTAINER, _CLASSIC, _ERROR, _FD_OBJECT = 10, 1, 73, 100
_CONTAINER_HEADER = struct.Struct("<4sHHLL H6xL4x")
_DEFLATED, _FASTEST = 2, 1
_ONE_NANOSECOND = 2
_REMOTE_FLAG = 0x80
_EPOCH_1990_NS = 631_152_000 * 10**9
"""Earlier stamps are times since a start, not dates: the file then has no date."""

_HEADER = [("signature", "S4"), ("header", "<u2"), ("version", "<u2"), ("size", "<u4"), ("kind", "<u4"),
           ("unit", "<u4"), ("client", "<u2"), ("object", "<u2"), ("at_ns", "<u8")]  # fmt: skip
_OBJECTS = {
    _CLASSIC: np.dtype(
        [*_HEADER, ("channel", "<u2"), ("flags", "u1"), ("dlc", "u1"), ("id", "<u4"), ("data", "u1", 8)]
    ),
    _ERROR: np.dtype(
        [*_HEADER, ("channel", "<u2"), ("length", "<u2"), ("flags", "<u4"), ("ecc", "u1"), ("position", "u1"),
         ("dlc", "u1"), ("pad", "u1"), ("frame", "<u4"), ("id", "<u4"), ("more", "<u2"), ("pad2", "<u2"),
         ("data", "u1", 8)]
    ),
    _FD_OBJECT: np.dtype(
        [*_HEADER, ("channel", "<u2"), ("flags", "u1"), ("dlc", "u1"), ("id", "<u4"), ("frame", "<u4"),
         ("bits", "u1"), ("fd", "u1"), ("valid", "u1"), ("pad", "u1", 5), ("data", "u1", 64)]
    ),
}  # fmt: skip
_CODES = np.zeros(65, np.uint8)
_CODES[sorted(FD_LENGTHS)] = np.arange(16)


class BlfWriter:
    """A BLF file."""

    def __init__(self, path: Path) -> None:
        self._file = NewFile(path)
        self._start_ns: int | None = None
        self._stop_ns = 0
        self._objects = 0
        self._uncompressed = _FILE_HEADER.size
        self._file.append(self._header())

    def write(self, records: Records) -> None:
        """One or more containers, then the header that counts them."""
        if not len(records):
            return
        stamps = records["at_ns"]
        if self._start_ns is None:
            # whole milliseconds, as the header's date: stamps in the file are relative to that date
            self._start_ns = int(stamps[0]) // 1_000_000 * 1_000_000
        self._stop_ns = int(stamps.max())
        most = CONTAINER_BYTES // _OBJECTS[_FD_OBJECT].itemsize
        for first in range(0, len(records), most):
            self._append(b"".join(_runs(records[first : first + most], self._start_ns)))
        self._objects += len(records)
        self._file.patch(0, self._header())

    def _append(self, objects: bytes) -> None:
        packed = zlib.compress(objects, _FASTEST)
        # the fastest level: the writer has to keep up with ten saturated buses
        size = _CONTAINER_HEADER.size + len(packed)
        header = _CONTAINER_HEADER.pack(b"LOBJ", 16, 1, size, _CONTAINER, _DEFLATED, len(objects))
        self._file.append(header + packed + bytes(size % 4))
        self._uncompressed += _CONTAINER_HEADER.size + len(objects)

    def _header(self) -> bytes:
        return _FILE_HEADER.pack(
            b"LOGG", _FILE_HEADER.size, *_APPLICATION, max(self._file.size, _FILE_HEADER.size), self._uncompressed,
            self._objects, 0, *_system_time(self._start_ns or 0), *_system_time(self._stop_ns),
        )  # fmt: skip

    def size(self) -> int:
        """Bytes in the file."""
        return self._file.size

    def close(self) -> None:
        """Close the file, which is whole already."""
        self._file.close()


def _runs(records: Records, start_ns: int) -> list[bytes]:
    """The objects of the records as bytes; consecutive records of one kind are converted together."""
    kinds = np.full(len(records), _CLASSIC)
    kinds[records["flags"] & FD != 0] = _FD_OBJECT
    kinds[records["can_id"] & ERROR != 0] = _ERROR
    bounds = [0, *(np.flatnonzero(np.diff(kinds)) + 1).tolist(), len(records)]
    return [_objects(records[a:b], int(kinds[a]), start_ns).tobytes() for a, b in pairwise(bounds)]


def _objects(records: Records, kind: int, start_ns: int) -> NDArray[np.void]:
    objects = np.zeros(len(records), _OBJECTS[kind])
    word, length, flags = records["can_id"], records["length"], records["flags"]
    objects["signature"], objects["header"], objects["version"] = b"LOBJ", 32, 1
    objects["size"], objects["kind"], objects["unit"] = objects.dtype.itemsize, kind, _ONE_NANOSECOND
    objects["at_ns"] = np.maximum(records["at_ns"] - start_ns, 0)
    # BLF counts channels from 1
    objects["channel"] = records["channel"].astype(np.uint16) + 1
    objects["id"] = word & np.uint32(EXTENDED_MASK | EXTENDED)
    objects["data"] = records["data"][:, : objects["data"].shape[1]]
    if kind == _ERROR:
        objects["id"] = 0
        objects["dlc"] = np.minimum(length, 8)
        return objects
    objects["flags"] = np.where(word & REMOTE, _REMOTE_FLAG, 0)
    objects["dlc"] = length
    if kind == _FD_OBJECT:
        objects["dlc"], objects["valid"] = _CODES[length], length
        objects["fd"] = 1 | np.where(flags & BRS, 2, 0) | np.where(flags & ESI, 4, 0)
    return objects


def _system_time(at_ns: int) -> tuple[int, ...]:
    """SYSTEMTIME of Windows, UTC; zeros for what is no date."""
    if at_ns < _EPOCH_1990_NS:
        return (0,) * 8
    t = datetime.datetime.fromtimestamp(at_ns // 1_000_000 / 1000, datetime.UTC)
    milliseconds = at_ns // 1_000_000 % 1000
    return (t.year, t.month, t.isoweekday() % 7, t.day, t.hour, t.minute, t.second, milliseconds)
