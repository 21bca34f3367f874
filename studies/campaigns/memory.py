"""Decodes the frames of a lockstep run in memory, without a file, for campaigns."""

from collections.abc import Sequence

import numpy as np

from bus.frame import Frame
from bus.rows import Frames, rows_of
from dbc import loader_database
from dbc.columns import ColumnDecoder, Columns
from dbc.recordings.logfile import FrameTable


def table_of(frames: Sequence[Frame]) -> FrameTable:
    """Classic frames as the table that a log of them would give; of a run that nobody has looked at, no object is made."""
    made, tables = frames.parts() if isinstance(frames, Frames) else (frames, ())
    rows = np.concatenate([rows_of(made), *tables])
    return FrameTable(
        time_ns=np.ascontiguousarray(rows["at_ns"]),
        can_id=np.ascontiguousarray(rows["can_id"]),
        length=np.ascontiguousarray(rows["length"]),
        flags=np.zeros(len(rows), np.uint8),
        data=np.ascontiguousarray(rows["data"]),
        channel=np.zeros(len(rows), np.uint8),
        channels=("loader",),
    )


def columns_of(frames: Sequence[Frame]) -> dict[str, Columns]:
    """The frames of the bus, decoded, by message name."""
    return ColumnDecoder(loader_database()).decode(table_of(frames))
