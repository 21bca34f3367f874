"""A bus inside one process, for lockstep and tests: deterministic, on the clock that it is given."""

import os
import time
from collections import deque
from collections.abc import Callable
from weakref import WeakValueDictionary

from bus import errors
from bus.closing import Closing
from bus.errors import FINDINGS_LIMIT, BusFinding
from bus.frame import ERROR, Frame
from bus.hub import packet
from bus.transport import BusClosed, Statistics

QUEUE_LIMIT = 16384
"""Frames that wait for one receiver before it loses some."""


class VirtualBus:
    """A frame sent on one connection waits at once at all the others, in the order of sending."""

    def __init__(self, clock: Callable[[], int] = time.monotonic_ns) -> None:
        """clock: the time now [ns]; frames get its reading, raised so that stamps strictly increase."""
        self._clock = clock
        self._stamp_ns = 0
        self._connections: list[VirtualTransport] = []

    def connect(self, *, queue_limit: int = QUEUE_LIMIT) -> "VirtualTransport":
        """A new connection; it receives what others send from now on."""
        connection = VirtualTransport(self, queue_limit)
        self._connections.append(connection)
        return connection

    def close(self) -> None:
        """End the bus: its connections give what has arrived, then raise BusClosed."""
        for connection in self._connections:
            connection.bus_ended()
        self._connections = []

    def carry(self, sender: "VirtualTransport", frame: Frame) -> None:
        """Stamp a frame and queue it at every connection but the sender's."""
        self._stamp_ns = max(self._clock(), self._stamp_ns + 1)
        stamped = frame._replace(at_ns=self._stamp_ns)
        for connection in self._connections:
            if connection is not sender:
                connection.put(stamped)

    def leave(self, connection: "VirtualTransport") -> None:
        """Forget a connection."""
        if connection in self._connections:
            self._connections.remove(connection)


class VirtualTransport(Closing):
    """A Transport on a VirtualBus; made by `VirtualBus.connect`."""

    def __init__(self, bus: VirtualBus, queue_limit: int) -> None:
        self._bus: VirtualBus | None = bus
        self._queue: deque[Frame] = deque()
        self._findings: deque[BusFinding] = deque(maxlen=FINDINGS_LIMIT)
        self._queue_limit = queue_limit
        self._received = self._sent = self._dropped_in = self._errors = 0
        self._ready = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)

    def send(self, frame: Frame) -> bool:
        """Queue one frame at all other connections; always accepted."""
        if self._bus is None:
            raise BusClosed("the virtual bus is closed")
        packet.check(frame)
        self._bus.carry(self, frame)
        self._sent += 1
        return True

    def put(self, frame: Frame) -> None:
        """A frame arrives (called by the bus)."""
        if len(self._queue) >= self._queue_limit:
            self._dropped_in += 1
            return
        # the descriptor is readable while the queue is not empty; written once, not per frame
        if not self._queue:
            os.eventfd_write(self._ready, 1)
        self._queue.append(frame)

    def bus_ended(self) -> None:
        """The bus is gone (called by the bus)."""
        self._bus = None
        os.eventfd_write(self._ready, 1)

    def drain(self, limit: int = 64) -> list[Frame]:
        """At most `limit` frames that have arrived, oldest first."""
        queue = self._queue
        if self._bus is None and not queue:
            raise BusClosed("the virtual bus is closed")
        frames = [queue.popleft() for _ in range(min(limit, len(queue)))]
        if frames and not queue and self._bus is not None:
            os.eventfd_read(self._ready)
        self._received += len(frames)
        for frame in frames:
            if frame.can_id & ERROR:
                self._errors += 1
                self._findings += errors.findings(frame)
        return frames

    def findings(self) -> list[BusFinding]:
        """Findings from error frames since the last call."""
        found = list(self._findings)
        self._findings.clear()
        return found

    def fileno(self) -> int:
        """Readable when `drain` has something to give, or the bus is gone."""
        return self._ready

    def statistics(self) -> Statistics:
        """Counters since opening."""
        return Statistics(
            received=self._received, sent=self._sent, dropped_in=self._dropped_in, errors=self._errors
        )

    def close(self) -> None:
        """Leave the bus; a second call does nothing."""
        if self._bus is not None:
            self._bus.leave(self)
            self._bus = None
        self._queue.clear()
        if self._ready >= 0:
            os.close(self._ready)
            self._ready = -1


_NAMED: WeakValueDictionary[str, VirtualBus] = WeakValueDictionary()


def named_bus(name: str) -> VirtualBus:
    """The bus of that name in this process; it lives as long as anybody is connected."""
    bus = _NAMED.get(name)
    if bus is None:
        bus = _NAMED[name] = VirtualBus()
    return bus
