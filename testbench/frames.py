"""Frames in memory as the table that every judgement reads."""

from collections.abc import Sequence

import numpy as np

from bus.frame import FD, Frame
from dbc.recordings.logfile import FrameTable


def table_of(frames: Sequence[Frame], channel: str = "bus") -> FrameTable:
    """One row per frame, in their order, all on one channel."""
    # 8 bytes per row unless there is CAN FD: a table of classic frames would otherwise be eight times as large
    width = 64 if any(frame.flags & FD for frame in frames) else 8
    # one buffer for all rows: an array per frame costs more than everything that is done with it
    joined = b"".join(frame.data.ljust(width, b"\0") for frame in frames)
    return FrameTable(
        time_ns=np.array([frame.at_ns for frame in frames], np.int64),
        can_id=np.array([frame.can_id for frame in frames], np.uint32),
        length=np.array([len(frame.data) for frame in frames], np.uint8),
        flags=np.array([frame.flags for frame in frames], np.uint8),
        data=np.frombuffer(joined, np.uint8).reshape(len(frames), width),
        channel=np.zeros(len(frames), np.uint8),
        channels=(channel,),
    )
