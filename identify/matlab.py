"""Reads the numeric vectors of MATLAB files of version 4 to 7. Every size and every code of the file is checked before it is used.

Texts, structures, cells, sparse and complex arrays, matrices and single numbers are passed over. SciPy reads them all, but takes a damaged code
as an index into memory, which ends the process (ADR 13); the layout here is that of its reader, and tests compare the two.
"""

import os
import struct
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CUT: Final = "ends too early; the file is cut off or damaged"
FREE: Final = 256 << 20
"""Bytes of vectors in memory that a file may have in any case."""
LIMIT: Final = 25
"""How many times longer than the file its vectors may be; measured channels come to 1 to 15, zlib's most is 1032."""
LONGEST_NAME: Final = 4096  # bytes; MATLAB's own names have 63
MOST_DIMENSIONS: Final = 32
CHUNK: Final = 1 << 16

HEADER: Final = 128  # bytes of text, version and byte order before the first variable from version 5 on
MATRIX: Final = 14
COMPRESSED: Final = 15
NUMBERS: Final[Mapping[int, str]] = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip
"""Types of stored numbers from version 5 on."""
FIRST_NUMERIC: Final = 6  # classes of variables: double, single and eight kinds of integers are 6 to 15
LAST_NUMERIC: Final = 15
COMPLEX: Final = 0x08  # a flag beside the class

NUMBERS_4: Final = ("f8", "f4", "i4", "i2", "u2", "u1")
"""Types of stored numbers in version 4."""
FULL_4: Final = 0  # kinds of matrices in version 4: full, text, sparse
SPARSE_4: Final = 2


class Damaged(ValueError):
    """The file is no MATLAB file, or a damaged one; the message names the place and the reason."""


class Newer(ValueError):
    """The file is of MATLAB 7.3, which writes HDF5."""


def vectors(path: Path) -> dict[str, Array]:
    """Numeric vectors (n,) by name, in the order of the file. Raises Damaged, Newer, OSError."""
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(0)
        room = _Room(FREE + LIMIT * size)
        head = file.read(HEADER)
        # version 4 begins with a number below 5000 in four bytes, later ones with text
        if 0 in head[:4]:
            return _version_4(file, size, room)
        return _version_5(file, size, _byte_order(head), room)


@dataclass(slots=True)
class _Room:
    """Memory that the vectors of a file may still take."""

    left: int  # bytes

    def claim(self, count: int) -> None:
        """Room for so many values, before they are read."""
        self.left -= 8 * count
        if self.left < 0:
            raise Damaged(f"claims more values than {LIMIT} times its length, {FREE >> 20} MiB apart")


@dataclass(slots=True)
class _Body:
    """The bytes of one variable, read in turn."""

    read: Callable[[int], bytes]  # exactly so many bytes, or Damaged
    left: int  # bytes that the variable still has, by its own length

    def take(self, count: int) -> bytes:
        """The next bytes; Damaged if the variable has no more."""
        if count > self.left:
            raise Damaged(CUT)
        self.left -= count
        return self.read(count)


def _name(content: bytes) -> str:
    name = content.decode("latin-1")
    if not name.isprintable():
        raise Damaged("the name of a variable has characters that cannot be printed")
    return name


def _length(dimensions: Sequence[int]) -> int | None:
    """Number of values of a vector; None for a single number, a matrix, and an array with no extent."""
    if any(n < 0 for n in dimensions):
        raise Damaged("a dimension is negative")
    longer = [n for n in dimensions if n != 1]
    return longer[0] if len(longer) == 1 else None


# from version 5 on: elements of a tag (type, length) and a body, in variables and around them


def _byte_order(head: bytes) -> str:
    """'<' or '>', for struct and NumPy."""
    order = {b"IM": "<", b"MI": ">"}.get(head[126:128])
    if order is None:
        raise Damaged("has no header of a MATLAB file")
    (version,) = struct.unpack(f"{order}H", head[124:126])
    if version >> 8 == 2:
        raise Newer
    if version >> 8 != 1:
        raise Damaged(f"has the unknown version {version >> 8}")
    return order


def _version_5(file: BinaryIO, size: int, order: str, room: _Room) -> dict[str, Array]:
    found: dict[str, Array] = {}
    at = HEADER
    while at < size:
        file.seek(at)
        kind, length = struct.unpack(f"{order}II", _exactly(file, 8))
        if kind not in (MATRIX, COMPRESSED):
            raise Damaged(f"at byte {at} is no variable but an element of type {kind}")
        if length > size - at - 8:
            raise Damaged(f"the variable at byte {at} {CUT}")
        try:
            if kind == COMPRESSED:
                found |= _compressed(_Inflated(file, length), order, room)
            else:
                found |= _variable(_Body(lambda n: _exactly(file, n), length), order, room)
        except Damaged as error:
            raise Damaged(f"the variable at byte {at}: {error}") from error
        at += 8 + length
    return found


def _compressed(inflated: "_Inflated", order: str, room: _Room) -> dict[str, Array]:
    kind, length = struct.unpack(f"{order}II", inflated.read(8))
    if kind != MATRIX:
        raise Damaged(f"holds no variable but an element of type {kind}")
    found = _variable(_Body(inflated.read, length), order, room)
    if found:  # what is passed over is not inflated
        inflated.check_end()
    return found


def _variable(body: _Body, order: str, room: _Room) -> dict[str, Array]:
    """The variable by its name, or nothing if it is no numeric vector."""
    flags = _element(body, order, 8)[1]
    if len(flags) != 8:
        raise Damaged(f"has {len(flags)} bytes of flags instead of 8")
    (word,) = struct.unpack_from(f"{order}I", flags)
    if not FIRST_NUMERIC <= word & 0xFF <= LAST_NUMERIC or word >> 8 & COMPLEX:
        return {}
    extents = _element(body, order, 4 * MOST_DIMENSIONS)[1]
    if len(extents) % 4:
        raise Damaged(f"has {len(extents)} bytes of dimensions of four bytes each")
    count = _length(struct.unpack(f"{order}{len(extents) // 4}i", extents))
    name = _name(_element(body, order, LONGEST_NAME)[1])
    # without a name: MATLAB's own notes on functions
    if count is None or not name:
        return {}
    kind, values = _element(body, order, 8 * count, lambda: room.claim(count))
    if kind not in NUMBERS:
        raise Damaged(f"'{name}' has values of the unknown type {kind}")
    stored = np.dtype(f"{order}{NUMBERS[kind]}")
    if len(values) != count * stored.itemsize:
        raise Damaged(f"'{name}' has {count} values of {stored.itemsize} bytes in {len(values)} bytes")
    return {name: np.frombuffer(values, stored).astype(np.float64)}


def _element(
    body: _Body, order: str, longest: int, before: Callable[[], None] = lambda: None
) -> tuple[int, bytes]:
    """Type and content of the next element. longest: its most bytes; before: called when its length has been checked."""
    tag = body.take(8)
    kind, length = struct.unpack(f"{order}II", tag)
    if short := kind >> 16:  # up to four bytes are written into the tag
        if short > 4:
            raise Damaged(f"has a short element of {short} bytes")
        return kind & 0xFFFF, tag[4 : 4 + short]
    if length > longest:
        raise Damaged(f"has an element of {length} bytes where {longest} are the most")
    before()
    content = body.take(length)
    body.take(min(-length % 8, body.left))  # some programs leave out the padding at the end of a variable
    return kind, content


def _exactly(file: BinaryIO, count: int) -> bytes:
    content = file.read(count)
    if len(content) < count:
        raise Damaged(CUT)
    return content


class _Inflated:
    """A compressed element, inflated as far as it is read."""

    def __init__(self, file: BinaryIO, length: int) -> None:
        self._file, self._left, self._zlib = file, length, zlib.decompressobj()

    def read(self, count: int) -> bytes:
        """The next bytes; Damaged if there are no more."""
        out = bytearray()
        while len(out) < count:
            piece = self._piece(count - len(out))
            if not piece and not self._more():
                raise Damaged(CUT)
            out += piece
        return bytes(out)

    def check_end(self) -> None:
        """Damaged unless the data end here, with the right checksum."""
        while not self._zlib.eof:
            if self._piece(1):
                raise Damaged("has bytes behind its end")
            if not self._more() and not self._zlib.eof:
                raise Damaged(CUT)

    def _more(self) -> bool:
        return not self._zlib.eof and bool(self._zlib.unconsumed_tail or self._left)

    def _piece(self, most: int) -> bytes:
        packed = self._zlib.unconsumed_tail
        if not packed and self._left:
            packed = _exactly(self._file, min(CHUNK, self._left))
            self._left -= len(packed)
        try:
            return self._zlib.decompress(packed, most)
        except zlib.error as error:
            raise Damaged(f"its compressed data are damaged: {error}") from error


# version 4: five integers, a name, and the numbers


def _version_4(file: BinaryIO, size: int, room: _Room) -> dict[str, Array]:
    found: dict[str, Array] = {}
    at = 0
    while at < size:
        try:
            file.seek(at)
            body = _Body(lambda n: _exactly(file, n), size - at)
            found |= _variable_4(body, room)
        except Damaged as error:
            raise Damaged(f"the variable at byte {at}: {error}") from error
        at = size - body.left
    return found


def _variable_4(body: _Body, room: _Room) -> dict[str, Array]:
    """As _variable; what is passed over is taken off `body.left`."""
    head = body.take(20)
    order = "<" if struct.unpack("<i", head[:4])[0] in range(5000) else ">"
    code, rows, columns, is_complex, length = struct.unpack(f"{order}5i", head)
    # decimal digits: byte order, nothing, type of the numbers, kind of the matrix
    if code not in range(5000) or code // 100 % 10 or code // 1000 != (order == ">"):
        raise Damaged("has no header of MATLAB 4")
    kind, form = code // 10 % 10, code % 10
    if kind >= len(NUMBERS_4) or form > SPARSE_4 or is_complex not in (0, 1):
        raise Damaged(f"has the unknown code {code} of MATLAB 4")
    if not 1 < length <= LONGEST_NAME:
        raise Damaged(f"has a name of {length} bytes")
    count = _length((rows, columns))
    name = _name(body.take(length).partition(b"\0")[0])
    if not name:
        raise Damaged("has no name")
    stored = np.dtype(f"{order}{NUMBERS_4[kind]}")
    if form == FULL_4 and not is_complex and count is not None:
        room.claim(count)
        return {name: np.frombuffer(body.take(count * stored.itemsize), stored).astype(np.float64)}
    skipped = rows * columns * stored.itemsize * (2 if is_complex and form != SPARSE_4 else 1)
    if skipped > body.left:
        raise Damaged(CUT)
    body.left -= skipped
    return {}
