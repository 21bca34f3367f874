"""Classic frames as rows of numbers in memory, for what hands on thousands of them per second without an object for each.

A row has the layout of `LibraryFrame` (deploy/c/runtime/library/library.h), so that a library in C reads it where it lies.
"""

import struct
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Final, NamedTuple, overload

import numpy as np
from numpy.typing import NDArray

from bus.frame import Frame

CLASSIC: Final = 8
"""Data bytes of a classic frame."""
LAYOUT: Final = np.dtype(
    {
        "names": ["at_ns", "can_id", "length", "data"],
        "formats": ["<i8", "<u4", "u1", ("u1", CLASSIC)],
        "offsets": [0, 8, 12, 13],
        "itemsize": 24,
    }
)
"""One frame: when it arrived, `can_id` word, bytes of data, data."""
SENT: Final = np.dtype(
    {
        "names": ["can_id", "length", "data"],
        "formats": ["<u4", "u1", ("u1", CLASSIC)],
        "offsets": [0, 4, 5],
        "itemsize": 16,
    }
)
"""One frame that is still to be sent: `EcuFrame` of deploy/c/runtime/ecu.h."""
_ROW: Final = struct.Struct("=qIB8s3x")
_made = tuple.__new__


class Rows(NamedTuple):
    """Columns of many rows, which are views of one table."""

    can_id: NDArray[np.uint32]  # (n,)
    length: NDArray[np.uint8]  # (n,)
    data: NDArray[np.uint8]  # (n, 8), those beyond the length are anything


def columns_of(table: NDArray[np.void]) -> Rows:
    """The columns of a table of LAYOUT or SENT."""
    return Rows(table["can_id"], table["length"], table["data"])


def frames_of(table: NDArray[np.void]) -> list[Frame]:
    """The frames of a table of LAYOUT."""
    rows: Iterable[tuple[Any, ...]] = _ROW.iter_unpack(table.tobytes())
    # not by Frame(...): half of the time of making one is the call
    return [_made(Frame, (can_id, data[:length], at_ns, 0)) for at_ns, can_id, length, data in rows]


def rows_of(frames: Iterable[Frame]) -> NDArray[np.void]:
    """A table of LAYOUT of classic frames."""
    packed = [_ROW.pack(at_ns, can_id, len(data), data) for can_id, data, at_ns, _ in frames]
    return np.frombuffer(b"".join(packed), LAYOUT)


class Frames(Sequence[Frame]):
    """Frames in their order. Those that come as rows become objects when somebody looks at one, and not before."""

    def __init__(self) -> None:
        self._made: list[Frame] = []
        self._rows: list[NDArray[np.void]] = []  # behind those that are made

    def extend(self, frames: Iterable[Frame]) -> None:
        """Add frames."""
        self._look().extend(frames)

    def append(self, frame: Frame) -> None:
        """Add one frame."""
        self._look().append(frame)

    def add(self, table: NDArray[np.void]) -> None:
        """Add the frames of a table of LAYOUT, which is not to be changed any more."""
        self._rows.append(table)

    def parts(self) -> tuple[Sequence[Frame], Sequence[NDArray[np.void]]]:
        """All frames as they are kept: objects first, then tables of rows."""
        return self._made, self._rows

    def _look(self) -> list[Frame]:
        for table in self._rows:
            self._made += frames_of(table)
        self._rows.clear()
        return self._made

    def __len__(self) -> int:
        return len(self._made) + sum(map(len, self._rows))

    @overload
    def __getitem__(self, place: int) -> Frame: ...

    @overload
    def __getitem__(self, place: slice) -> list[Frame]: ...

    def __getitem__(self, place: int | slice) -> Frame | list[Frame]:
        return self._look()[place]

    def __iter__(self) -> Iterator[Frame]:
        return iter(self._look())

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and self._look() == list(other)

    __hash__ = None  # type: ignore[assignment]  # it grows

    def __repr__(self) -> str:
        return f"Frames({self._look()!r})"
