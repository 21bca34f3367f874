"""Reads from the rows of a table what the steps of a counter need: counters, and whether a payload comes again.

Apart from `dbc.tally.counters`, because processes that judge live frames need no reader of recordings, and no numba.
"""

import numpy as np
from numpy.typing import NDArray

from dbc.database import MessageCodec
from dbc.recordings.logfile import FrameTable

_COUNTER_BYTE, _COUNTER_BITS = 1, 0x0F  # AUTOSAR E2E profile 1


class LastPayload:
    """Compares each frame of a message with the one before it, also across pieces."""

    def __init__(self) -> None:
        self._last: NDArray[np.uint64] | None = None

    def same(self, table: FrameTable, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Whether each row has the bytes of the frame before it, (n,); the first frame of all never has."""
        words = np.ascontiguousarray(table.data).view(np.uint64)[rows]
        equal = np.zeros(rows.size, np.bool_)
        if rows.size:
            alike = words[1:] == words[:-1]
            # classic frames are one word, and a reduction over one costs more than the comparison
            equal[1:] = alike[:, 0] if alike.shape[1] == 1 else alike.all(axis=1)
            if self._last is not None:
                equal[0] = _equal(self._last, words[0])
            self._last = words[-1].copy()
        return equal


def _equal(one: NDArray[np.uint64], other: NDArray[np.uint64]) -> bool:
    """Whether two payloads are equal; pieces with CAN FD frames have wider rows, zero beyond a frame's end."""
    width = min(one.size, other.size)
    return bool((one[:width] == other[:width]).all() and not one[width:].any() and not other[width:].any())


def counters_of(codec: MessageCodec, table: FrameTable, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """The alive counter of each row of a protected message, (n,)."""
    protection = codec.protection
    if protection is None or codec.profile is not None:
        return (table.data[rows, _COUNTER_BYTE] & _COUNTER_BITS).astype(np.int64)
    # A user's hook reads one frame at a time, and only frames of the message's length.
    whole = table.data[rows, : codec.length]
    lengths = table.length[rows].tolist()
    read = (
        protection.counter(row.tobytes()) if length == codec.length else protection.counters
        for row, length in zip(whole, lengths, strict=True)
    )
    return np.fromiter(read, np.int64, rows.size)
