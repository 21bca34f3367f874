"""Plays a recording onto buses: each frame at its time, or all as fast as the buses accept them.

`Player` is pure: it takes the time as an argument and returns when it has to be called again. Times are absolute, so
that a late frame delays no other one. A frame that a bus does not accept is offered again; none is left out.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bus.frame import ERROR, Frame
from dbc.recordings.logfile import FrameTable

RETRY_NS = 500_000
"""Pause before a refused frame is offered again [ns]."""
TURN = 256
"""Most frames per call, so that the caller can handle signals and received frames in between."""


class Sink(Protocol):
    """What is needed of a bus."""

    def send(self, frame: Frame) -> bool: ...


@dataclass(slots=True)
class Progress:
    """Counters of a replay."""

    sent: int = 0
    refused: int = 0  # offers that a bus did not accept
    largest_late_ns: int = 0
    total_late_ns: int = 0
    rounds: int = 0  # complete passes through the recording


def due_ns(time_ns: NDArray[np.int64], speed: float | None) -> NDArray[np.int64]:
    """When each frame is due after the start [ns]; speed: times the recorded one, None: at once.

    A stamp that runs backwards is due with the frame before it.
    """
    if speed is None:
        return np.zeros(time_ns.size, np.int64)
    ordered = np.maximum.accumulate(time_ns)
    return np.asarray(np.rint((ordered - ordered[0]) / speed), np.int64)


class Player:
    """Sends the frames of a table on the buses of their channels."""

    def __init__(
        self,
        table: FrameTable,
        sinks: Mapping[str, Sink],
        start_ns: int,
        *,
        speed: float | None = 1.0,
        loop: bool = False,
    ) -> None:
        """sinks: by name of channel; frames of other channels, and error frames, which no bus takes, are left out."""
        wanted = np.isin(table.channel, [k for k, name in enumerate(table.channels) if name in sinks])
        table = table.select(wanted & (table.can_id & ERROR == 0))
        self._frames: Sequence[Frame] = list(table.frames())
        self._sinks = [sinks[table.channels[k]] for k in table.channel.tolist()]
        due = due_ns(table.time_ns, speed) if len(table) else np.zeros(0, np.int64)
        self._due: list[int] = due.tolist()
        # one mean gap after the last frame, so that a looped recording has no two frames at one time
        self._round_ns = int(due[-1] + due[-1] // max(len(due) - 1, 1)) if len(table) else 0
        self._start_ns, self._loop = start_ns, loop
        self._paced = speed is not None
        self._next = 0
        self.progress = Progress()

    def __len__(self) -> int:
        return len(self._frames)

    def advance(self, now_ns: int) -> int | None:
        """Send what is due; when to be asked again [ns], None when everything is sent."""
        progress, start_ns = self.progress, self._start_ns
        rows = range(self._next, len(self._frames))
        for row in islice(rows, TURN):
            late_ns = now_ns - start_ns - self._due[row]
            if late_ns < 0:
                return start_ns + self._due[row]
            if not self._sinks[row].send(self._frames[row]._replace(at_ns=0)):
                progress.refused += 1
                return now_ns + RETRY_NS
            self._next = row + 1
            progress.sent += 1
            if self._paced:
                progress.largest_late_ns = max(progress.largest_late_ns, late_ns)
                progress.total_late_ns += late_ns
        if self._next < len(self._frames):
            return now_ns
        progress.rounds += 1
        if not self._loop or not self._frames:
            return None
        self._next = 0
        self._start_ns = start_ns + self._round_ns if self._paced else now_ns
        return self._start_ns
