"""A bus that is heard all the time: a thread drains it, so that a test that thinks for long loses no frame."""

import asyncio
import contextlib
import selectors
import threading
import time
from collections.abc import Callable

from bus.frame import Frame
from bus.transport import BusClosed, Transport

# How soon the thread sees that it shall end [s]; frames wake it at once.
LOOK_S = 0.05


class Listener:
    """Frames of a transport, stamped on a clock of their own. `lost` when the bus is gone."""

    def __init__(
        self, bus: Transport, due: Callable[[int], list[Frame]] | None = None, *, zero_ns: int | None = None
    ) -> None:
        """due: frames to send at a time [ns of the monotonic clock]; asked often. zero_ns: start of the clock; None: the first frame."""
        self._bus = bus
        self._due = due
        self.record: list[Frame] = []
        self.zero_ns = zero_ns
        self.lost = False
        # made on the test's loop and set from the thread: only `call_soon_threadsafe` may do that
        self._came = asyncio.Event()
        self._loop = asyncio.get_running_loop()
        self._ending = threading.Event()
        self._lock = threading.Lock()
        self._given = 0
        self._thread = threading.Thread(target=self._listen, name="bench-listener", daemon=True)
        self._thread.start()

    def _listen(self) -> None:
        with selectors.DefaultSelector() as selector:
            selector.register(self._bus.fileno(), selectors.EVENT_READ)
            while not self._ending.is_set():
                try:
                    # a rest bus sends at most 1 ms late then, a tenth of the shortest cycle time in loader.dbc
                    selector.select(0.001 if self._due is not None else LOOK_S)
                    self._exchange(time.monotonic_ns())
                except BusClosed:
                    self.lost = True
                    self._wake()
                    return

    def _exchange(self, now_ns: int) -> None:
        frames: list[Frame] = []
        while more := self._bus.drain():
            # stamps of kernel or hub are nearer to the wire than ours; a transport without stamps leaves 0
            frames += [f if f.at_ns else f._replace(at_ns=now_ns) for f in more]
        if self._due is not None:
            for frame in self._due(now_ns):
                self._bus.send(frame)
                # the transport does not give back what it sends, yet the record has to hold the whole bus
                frames.append(frame._replace(at_ns=now_ns))
        if not frames:
            return
        with self._lock:
            # as in a recording: starting the machine takes seconds
            if self.zero_ns is None:
                self.zero_ns = frames[0].at_ns
            self.record += [frame._replace(at_ns=frame.at_ns - self.zero_ns) for frame in frames]
        self._wake()

    def _wake(self) -> None:
        # the bus may go after the test has ended its loop
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._came.set)

    @property
    def now_s(self) -> float:
        """Since the first frame; 0 before it."""
        return 0.0 if self.zero_ns is None else (time.monotonic_ns() - self.zero_ns) * 1e-9

    async def frames(self, until_s: float) -> list[Frame] | None:
        """What came since the last call, waiting for it until a time; None when the bus is gone and all is given."""
        with self._lock:
            waiting = len(self.record) > self._given
        if not waiting and not self.lost:
            # cleared after the look at the record and before the wait: a frame in between is found in the next round
            self._came.clear()
            # never longer than LOOK_S: `now_s` goes on without frames, and the caller has to see its time pass
            left_s = min(max(until_s - self.now_s, 0.0), LOOK_S) if self.zero_ns is not None else LOOK_S
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._came.wait(), left_s)
        with self._lock:
            frames, self._given = self.record[self._given :], len(self.record)
        return None if self.lost and not frames else frames

    def close(self) -> None:
        """Stop listening and leave the bus."""
        self._ending.set()
        # bounded: a transport that hangs must not hang the test; the thread is a daemon
        self._thread.join(5.0)
        self._bus.close()
