"""Decodes the frames of a lockstep run in memory, without a file, for campaigns."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bus.frame import Frame
from bus.rows import LAYOUT, Frames
from dbc import loader_database
from dbc.columns import ColumnDecoder, Columns
from dbc.recordings.logfile import FrameTable

CLASSIC = 8  # data bytes of a classic CAN frame


def table_of(frames: Sequence[Frame]) -> FrameTable:
    """Classic frames as the table that a log of them would give."""
    count = len(frames)
    if isinstance(frames, Frames) and not frames.parts()[0]:  # nobody has looked at one: no object is made
        rows = np.concatenate([np.zeros(0, LAYOUT), *frames.parts()[1]])
        at_ns, can_id, length, data = (
            np.ascontiguousarray(rows[name]) for name in ("at_ns", "can_id", "length", "data")
        )
        return _table(at_ns, can_id, length, data, np.zeros(count, np.uint8))
    joined = b"".join(frame.data.ljust(CLASSIC, b"\0") for frame in frames)
    return _table(
        np.array([frame.at_ns for frame in frames], np.int64),
        np.array([frame.can_id for frame in frames], np.uint32),
        np.array([len(frame.data) for frame in frames], np.uint8),
        np.frombuffer(joined, np.uint8).reshape(count, CLASSIC),
        np.array([frame.flags for frame in frames], np.uint8),
    )


def _table(
    at_ns: NDArray[np.int64],
    can_id: NDArray[np.uint32],
    length: NDArray[np.uint8],
    data: NDArray[np.uint8],
    flags: NDArray[np.uint8],
) -> FrameTable:
    return FrameTable(
        time_ns=at_ns,
        can_id=can_id,
        length=length,
        flags=flags,
        data=data,
        channel=np.zeros(len(at_ns), np.uint8),
        channels=("loader",),
    )


def columns_of(frames: Sequence[Frame]) -> dict[str, Columns]:
    """The frames of the bus, decoded, by message name."""
    return ColumnDecoder(loader_database()).decode(table_of(frames))
