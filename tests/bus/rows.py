"""Frames as a table of rows, written out by hand."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bus.frame import Frame
from bus.rows import LAYOUT


def table_of(frames: Sequence[Frame], table: NDArray[np.void] | None = None) -> NDArray[np.void]:
    """The frames in the first rows of a table, else in one of their own."""
    table = np.zeros(len(frames), LAYOUT) if table is None else table
    for row, frame in zip(table, frames, strict=False):
        row["can_id"], row["length"] = frame.can_id, len(frame.data)
        row["data"][: len(frame.data)] = list(frame.data[:8])
        if "at_ns" in table.dtype.names:
            row["at_ns"] = frame.at_ns
    return table
