"""The true motion of a run: rows go to a file as they come, which becomes truth.npz at the end. Memory stays flat."""

import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bus.closing import Closing
from plant.truth import Truth, columns_of


class TruthRecorder(Closing):
    """Collects Truth samples."""

    def __init__(self, folder: Path | None = None) -> None:
        """folder: on whose file system the rows wait, in a file without a name that goes with this process."""
        self._rows = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115  # closed by `close`
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def append(self, truth: Truth) -> None:
        """Keep one sample."""
        self._rows.write(truth.row.tobytes())
        self._count += 1

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """The samples so far, by field of Truth, first axis time."""
        self._rows.flush()
        shape = (self._count, Truth.size)
        rows = np.memmap(self._rows, np.float64, "r", shape=shape) if self._count else np.empty(shape)
        return columns_of(rows)

    def save(self, path: Path) -> None:
        """Write truth.npz; a reader never sees half a file."""
        partial = path.with_name(path.name + ".partial")
        with partial.open("wb") as file:
            np.savez(file, **self.columns())  # type: ignore[arg-type]  # numpy's stub takes allow_pickle for a column
        partial.replace(path)

    def close(self) -> None:
        """Let go of the rows; a second call does nothing."""
        self._rows.close()
