"""Counts the steps of one message's alive counter: repeated frames, jumps, and frames lost in between. Pure."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dbc.database import MessageCodec
from dbc.recordings.logfile import FrameTable

_COUNTER_BYTE, _COUNTER_BITS = 1, 0x0F  # AUTOSAR E2E profile 1


@dataclass(slots=True)
class CounterSteps:
    """Takes stamps and counters of a message in the order of arrival.

    A counter gives a step only modulo its number of values; the time between the frames selects among the candidates.
    """

    period_ns: int
    modulus: int  # number of values of the counter
    duplicates: int = 0
    jumps: int = 0
    errors: int = (
        0  # of the jumps, those that a pause of the sender for a turn of the counter cannot look like
    )
    lost: int = 0  # frames between sender and us
    _last: tuple[int, int] | None = None  # stamp and counter of the last frame

    def add(
        self, at_ns: NDArray[np.int64], counters: NDArray[np.int64], same: NDArray[np.bool_] | None
    ) -> None:
        """Count the steps up to these frames. same: whether each has the payload of the one before it; None: not known."""
        if not at_ns.size:
            return
        if self._last is None:
            same = None if same is None else same[1:]
        else:
            at_ns = np.concatenate((np.array([self._last[0]]), at_ns))
            counters = np.concatenate((np.array([self._last[1]]), counters))
        self._last = int(at_ns[-1]), int(counters[-1])
        modulo = np.diff(counters) % self.modulus
        outside = (counters < 0) | (counters >= self.modulus)
        periods = np.diff(at_ns) / self.period_ns
        # nearly always every counter follows the one before it, within half a turn
        if (modulo == 1).all() and not outside.any() and periods.max(initial=0) < self.modulus / 2:
            return
        turns = np.maximum(np.rint((periods - modulo) / self.modulus), 0)
        step = (modulo + self.modulus * turns).astype(np.int64)
        still = step == 0
        duplicate = still if same is None else still & same
        jump = (step > 1) | (still & ~duplicate) | outside[1:]
        # one step in a gap of fifteen periods: fifteen frames were lost, or the sender paused and none was sent
        paused = (modulo == 1) & ~outside[1:]
        self.duplicates += int(duplicate.sum())
        self.jumps += int(jump.sum())
        self.errors += int((jump & ~paused).sum())
        self.lost += int((step[step > 1] - 1).sum())


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
