"""Stamps the frames by which the loop's reaction is measured, between a process and its bus.

Three messages mark the loop: the sample carries a sequence number, the ECU's status echoes the newest
one that its cycle used, and the limits go out in the same cycle. Neither the cores nor their shells know of
the tap. Rows go to a file as they come: memory stays constant, and a killed process leaves the rows until then.

A row is four integers: kind, number (sequence, echo, or 0), stamp of the bus, stamp of the process [ns].
The stamp of the process is that of reading for a frame that was heard, and that before sending for one sent.
Of a tick they are its due time, its end and its start.
"""

import struct
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from bus.address import open_transport
from bus.closing import Closing
from bus.errors import BusFinding
from bus.frame import Frame
from bus.pacing import TickTiming, columns_of
from bus.transport import Statistics, Transport
from dbc import loader_database
from dbc.database import Database
from hil.gateway.hops import Kind
from hil.timing.host import OwnWaits

ROW: Final = struct.Struct("=4q")
FLUSH_ROWS: Final = 16
"""Rows that a kill can lose: some 50 ms of a process that ticks every 10 ms."""


TRACED: Final = (
    (Kind.HEARD_SAMPLE, "Articulation", "SampleSequence"),
    (Kind.HEARD_LIMITS, "Limits", ""),
    (Kind.HEARD_STATUS, "EcuStatus", "EchoSequence"),
)
"""Kind when heard, message, and the signal that is its number."""


class StampWriter(Closing):
    """Appends rows to a file, a handful at a time."""

    def __init__(self, file: Path) -> None:
        self._file = file.open("wb")
        self._rows = bytearray()

    def add(self, kind: int, number: int, bus_ns: int, process_ns: int) -> None:
        """One row."""
        self._rows += ROW.pack(kind, number, bus_ns, process_ns)
        if len(self._rows) >= FLUSH_ROWS * ROW.size:
            self._flush()

    def _flush(self) -> None:
        self._file.write(self._rows)
        self._file.flush()
        self._rows.clear()

    def close(self) -> None:
        """Write what is left; a second call does nothing."""
        if not self._file.closed:
            self._flush()
            self._file.close()


def read_stamps(file: Path) -> NDArray[np.int64]:
    """The rows of a file, shape (n, 4); a row that was cut off by a kill is left out. No file: no rows."""
    if not file.exists():
        return np.empty((0, 4), np.int64)
    content = file.read_bytes()
    # a kill may have cut the last row
    whole = len(content) // ROW.size * ROW.size
    return np.frombuffer(content[:whole], np.int64).reshape(-1, 4)


class Tap(Closing):
    """Wraps a Transport and stamps its traced frames."""

    def __init__(self, transport: Transport, stamps: StampWriter, database: Database) -> None:
        self._transport = transport
        self._stamps = stamps
        self._traced = {}
        for kind, message, signal in TRACED:
            codec = database.by_name[message]
            place = codec.signals.index(signal) if signal else None
            self._traced[codec.can_id] = (kind, codec, place)

    def _note(self, frame: Frame, sent: bool, now_ns: int) -> None:
        kind, codec, place = self._traced[frame.can_id]
        # a frame that an injected fault has shortened carries no number
        if len(frame.data) >= codec.length:
            number = int(codec.decode(frame.data)[place]) if place is not None else 0
            self._stamps.add(kind + sent, number, 0 if sent else frame.at_ns, now_ns)

    def send(self, frame: Frame) -> bool:
        """As the transport's."""
        if frame.can_id in self._traced:
            # before sending: the system call belongs to the time on the bus, not to the process
            self._note(frame, True, time.monotonic_ns())
        return self._transport.send(frame)

    def drain(self, limit: int = 64) -> list[Frame]:
        """As the transport's."""
        frames = self._transport.drain(limit)
        if frames:
            # one reading for the batch: its frames became readable together
            now_ns, traced = time.monotonic_ns(), self._traced
            for frame in frames:
                if frame.can_id in traced:
                    self._note(frame, False, now_ns)
        return frames

    def findings(self) -> list[BusFinding]:
        """As the transport's."""
        return self._transport.findings()

    def fileno(self) -> int:
        """As the transport's."""
        return self._transport.fileno()

    def statistics(self) -> Statistics:
        """As the transport's."""
        return self._transport.statistics()

    def close(self) -> None:
        """As the transport's; the stamps stay open."""
        self._transport.close()


@contextmanager
def tapped(
    address: str, name: str, file: Path | None, waits: OwnWaits | None = None
) -> Iterator[tuple[Transport, TickTiming]]:
    """The bus at `address` and the timing of the process `name`, both stamped into `file` if one is given.

    waits: looked at at the end of each tick.
    """
    with ExitStack() as stack:
        bus = stack.enter_context(open_transport(address, name=name))
        if file is None:
            yield bus, TickTiming()
        else:
            stamps = stack.enter_context(StampWriter(file))
            yield Tap(bus, stamps, loader_database()), TappedTiming(stamps, waits)


class TappedTiming(TickTiming):
    """Writes the times of a process' ticks among its stamps."""

    def __init__(self, stamps: StampWriter, waits: OwnWaits | None = None) -> None:
        super().__init__()
        self._stamps = stamps
        self._waits = waits

    def add(self, due_ns: int, started_ns: int, ended_ns: int) -> None:
        """Add one tick. Called at the end of the tick."""
        # in the order due, end, start: column 2 is that of the bus' stamp, which a tick does not have
        self._stamps.add(Kind.TICK, due_ns, ended_ns, started_ns)
        if self._waits is not None:
            self._waits.look(ended_ns, due_ns)


def ticks_of(rows: NDArray[np.int64]) -> dict[str, NDArray[np.int64]]:
    """Due time, lateness and execution [ns] of the ticks among the stamps of a process."""
    ticks = rows[rows[:, 0] == Kind.TICK]
    return columns_of(ticks[:, [1, 3, 2]])
