"""Decodes the frames of a lockstep run in memory, without a file, for campaigns."""

from collections.abc import Sequence

import numpy as np

from bus.frame import Frame
from dbc import loader_database
from dbc.columns import ColumnDecoder, Columns
from dbc.recordings.logfile import FrameTable

CLASSIC = 8  # data bytes of a classic CAN frame


def table_of(frames: Sequence[Frame]) -> FrameTable:
    """Classic frames as the table that a log of them would give."""
    count = len(frames)
    data = b"".join(frame.data.ljust(CLASSIC, b"\0") for frame in frames)
    return FrameTable(
        time_ns=np.array([frame.at_ns for frame in frames], np.int64),
        can_id=np.array([frame.can_id for frame in frames], np.uint32),
        length=np.array([len(frame.data) for frame in frames], np.uint8),
        flags=np.array([frame.flags for frame in frames], np.uint8),
        data=np.frombuffer(data, np.uint8).reshape(count, CLASSIC),
        channel=np.zeros(count, np.uint8),
        channels=("loader",),
    )


def columns_of(frames: Sequence[Frame]) -> dict[str, Columns]:
    """The frames of the bus, decoded, by message name."""
    return ColumnDecoder(loader_database()).decode(table_of(frames))
