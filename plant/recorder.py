"""The true motion of a run, kept in an array allocated beforehand and written as truth.npz."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from plant.truth import Truth, columns_of


class TruthRecorder:
    """Collects Truth samples; the array doubles when it is full."""

    def __init__(self, capacity: int = 4096) -> None:
        self._rows = np.empty((capacity, Truth.size))
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def append(self, truth: Truth) -> None:
        """Keep one sample."""
        if self._count == len(self._rows):
            self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])
        self._rows[self._count] = truth.row
        self._count += 1

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """The samples so far, by field of Truth, first axis time."""
        return columns_of(self._rows[: self._count])

    def save(self, path: Path) -> None:
        """Write truth.npz; a reader never sees half a file."""
        partial = path.with_name(path.name + ".partial")
        with partial.open("wb") as file:
            np.savez(file, **self.columns())  # type: ignore[arg-type]  # numpy's stub takes allow_pickle for a column
        partial.replace(path)
