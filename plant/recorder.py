"""The true motion of a run: rows go to a file as they come, which becomes truth.npz at the end. Memory stays flat.

A row is in the hands of the kernel when `append` returns, so that a killed process leaves every row up to its last tick.
"""

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bus.closing import Closing
from plant.truth import Truth, columns_of

_HEAD = struct.Struct("<8sQ")
_MAGIC = b"truth\0\0\1"
_NUMBER = np.dtype("<f8")


class TruthRecorder(Closing):
    """Collects Truth samples."""

    def __init__(self, path: Path) -> None:
        """path: of truth.npz; until then the rows wait beside it, in `rows_of(path)`."""
        self._path = path
        self._rows = rows_of(path).open("wb", buffering=0)
        self._rows.write(_HEAD.pack(_MAGIC, Truth.size))
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def append(self, truth: Truth) -> None:
        """Keep one sample."""
        self._rows.write(truth.row.astype(_NUMBER, copy=False).tobytes())
        self._count += 1

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """The samples so far, by field of Truth, first axis time."""
        return read_rows(rows_of(self._path))

    def save(self) -> None:
        """Write truth.npz and remove the rows; a reader never sees half a file."""
        partial = self._path.with_name(self._path.name + ".partial")
        with partial.open("wb") as file:
            np.savez(file, **self.columns())  # type: ignore[arg-type]  # numpy's stub takes allow_pickle for a column
        partial.replace(self._path)
        rows_of(self._path).unlink()

    def close(self) -> None:
        """Close the file of rows; a second call does nothing."""
        self._rows.close()


def rows_of(path: Path) -> Path:
    """The file in which the rows of a truth.npz wait."""
    return path.with_suffix(".rows")


def read_rows(file: Path) -> dict[str, NDArray[np.float64]]:
    """The rows of a file by field of Truth, mapped and not copied; a row that a kill cut off is left out.

    Raises ValueError for a file of another version, OSError if it cannot be read.
    """
    with file.open("rb") as stream:
        head = stream.read(_HEAD.size)
    if len(head) < _HEAD.size or _HEAD.unpack(head) != (_MAGIC, Truth.size):
        raise ValueError("no rows of this version")
    count = (file.stat().st_size - _HEAD.size) // (Truth.size * _NUMBER.itemsize)
    shape = (count, Truth.size)
    rows = np.memmap(file, _NUMBER, "r", _HEAD.size, shape) if count else np.empty(shape)
    return columns_of(rows)
