"""The true motion of a run, kept in arrays allocated beforehand and written as truth.npz."""

import dataclasses
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from plant.truth import Truth

FIELDS = tuple(field.name for field in dataclasses.fields(Truth))


class TruthRecorder:
    """Collects Truth samples; the arrays double when they are full."""

    def __init__(self, capacity: int = 4096) -> None:
        self._capacity = capacity
        self._count = 0
        self._columns: dict[str, NDArray[np.float64]] = {}

    def __len__(self) -> int:
        return self._count

    def append(self, truth: Truth) -> None:
        """Keep one sample."""
        if not self._columns:
            for name in FIELDS:
                shape = np.shape(getattr(truth, name))
                self._columns[name] = np.empty((self._capacity, *shape))
        elif self._count == self._capacity:
            self._grow()
        for name, column in self._columns.items():
            column[self._count] = getattr(truth, name)
        self._count += 1

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """The samples so far, by field of Truth, first axis time."""
        return {name: column[: self._count] for name, column in self._columns.items()}

    def save(self, path: Path) -> None:
        """Write truth.npz; a reader never sees half a file."""
        partial = path.with_name(path.name + ".partial")
        with partial.open("wb") as file:
            np.savez(file, **self.columns())  # type: ignore[arg-type]  # numpy's stub takes allow_pickle for a column
        partial.replace(path)

    def _grow(self) -> None:
        for name, column in self._columns.items():
            self._columns[name] = np.concatenate([column, np.empty_like(column)])
        self._capacity *= 2
