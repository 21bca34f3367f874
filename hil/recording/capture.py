"""The recorder's first process: receives frames from the buses and puts them into the ring.

Receiving and writing are two processes: a file system that blocks for a second then costs no frame.
"""

import contextlib
import select
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bus.address import open_transport
from bus.ticks import Alarm
from bus.transport import BusClosed, Statistics, Transport
from bus.user_error import UserError
from hil.ending import Ending
from hil.recording.files import Plan, names_of
from hil.recording.ring import SLOTS, Ring
from hil.recording.writing import WriterProcess, Written
from hil.shell.lifeline import Lifeline
from hil.shell.process import Stop

NAP_S = 0.002
"""Pause after each wake-up [s]. At most 16 frames of a full 1 Mbit/s bus wait meanwhile; the smallest receive buffers hold some hundreds."""


class SourceError(UserError, ValueError):
    """The name of a bus to record is not valid; the message names the bus and the correct form."""


@dataclass(frozen=True, slots=True)
class Source:
    """One bus of a recording."""

    name: str  # of the channel in the recording
    address: str

    @classmethod
    def parse(cls, text: str) -> "Source":
        """`NAME=ADDRESS`, or an address alone, which is then called after its last part."""
        name, separator, address = text.partition("=")
        if not separator or ":" in name:
            address = text
            name = Path(text.partition(":")[2].lstrip("@")).stem
        if not name or any(character.isspace() for character in name):
            raise SourceError(f"{text!r}: {name!r} cannot be the name of a channel; write NAME={address}")
        return cls(name, address)


def parse_sources(texts: Sequence[str]) -> list[Source]:
    """The buses of a recording; SourceError if two have the same name."""
    sources = [Source.parse(text) for text in texts]
    names = [source.name for source in sources]
    if len(names) > 64:
        raise SourceError(f"{len(names)} buses: a recording holds at most 64")
    for name in names:
        if names.count(name) > 1:
            both = " and ".join(source.address for source in sources if source.name == name)
            raise SourceError(f"{both} would both be called {name!r}; give one a name: NAME=ADDRESS")
    return sources


class Capture:
    """Open buses that are drained into a ring."""

    def __init__(self, buses: Sequence[Transport], names: Sequence[str], ring: Ring) -> None:
        self._buses = list(buses)
        self._names = tuple(names)
        self._ring = ring
        self._epoll = select.epoll()
        for bus in self._buses:
            self._epoll.register(bus.fileno(), select.EPOLLIN)
        self.lost: dict[str, str] = {}

    def fileno(self) -> int:
        """Readable when a bus is."""
        return self._epoll.fileno()

    @property
    def ended(self) -> bool:
        """Whether every bus is gone."""
        return len(self.lost) == len(self._buses)

    def drain(self) -> None:
        """Move all arrived frames into the ring; a bus that is gone is noted, and the others continue."""
        for number, (bus, name) in enumerate(zip(self._buses, self._names, strict=True)):
            if name in self.lost:
                continue
            try:
                while frames := bus.drain():
                    self._ring.put(frames, number)
            except BusClosed as error:
                self.lost[name] = str(error)
                self._epoll.unregister(bus.fileno())

    def statistics(self) -> Statistics:
        """Sums over the buses."""
        counts = [bus.statistics() for bus in self._buses]
        return Statistics(
            received=sum(count.received for count in counts),
            dropped_in=sum(count.dropped_in for count in counts),
        )

    def close(self) -> None:
        """Stop watching; the buses belong to whoever opened them."""
        self._epoll.close()


def run(
    line: Lifeline,
    addresses: Sequence[str],
    plan: Plan,
    *,
    duration_s: float | None = None,
    slots: int = SLOTS,
) -> Ending:
    """Record until a signal, until `duration_s` is over, or until every bus is gone. Every frame received by then is written."""
    with contextlib.ExitStack() as stack:
        buses = [stack.enter_context(open_transport(address, name="recorder")) for address in addresses]
        ring = stack.enter_context(contextlib.closing(Ring.create(slots)))
        writer = WriterProcess(ring, plan)
        stack.callback(writer.finish)
        capture = stack.enter_context(contextlib.closing(Capture(buses, plan.channels, ring)))
        started = time.monotonic()
        complete = _listen(line, capture, writer, duration_s)
        capture.drain()  # frames that arrived before the end belong to the recording
        elapsed_s = time.monotonic() - started
        written = writer.finish()
        counts = capture.statistics()
        lost = Lost(in_buses=counts.dropped_in, in_ring=ring.dropped)
    line.finished(complete=True, frames=written.frames, received=counts.received, sent=0, dropped=lost.total)
    if not line.supervised and written.paths:
        print(summary(written, len(addresses), elapsed_s, lost))
    if written.error:
        line.error(f"the recording ended early: {written.error}; {written.frames} frames are in it")
        return Ending.FAILED
    for reason in capture.lost.values():
        line.error(f"lost the bus: {reason}")
    if capture.lost:
        return Ending.HUB_LOST
    if lost.total:
        return Ending.FAILED
    return Ending.PASSED if complete or line.supervised else Ending.INTERRUPTED


def _listen(line: Lifeline, capture: Capture, writer: WriterProcess, duration_s: float | None) -> bool:
    """Move frames from the buses into the ring; returns whether the whole duration was recorded."""
    with Stop() as stop, contextlib.closing(Alarm()) as alarm, select.epoll() as watched:
        for source in (capture, writer, alarm):
            watched.register(source.fileno(), select.EPOLLIN)
        if duration_s is not None:
            alarm.set(time.monotonic_ns() + round(duration_s * 1e9))
        line.ready()
        for _ in stop.readable(watched.fileno()):
            capture.drain()
            ready = {descriptor for descriptor, _ in watched.poll(0)}
            if alarm.fileno() in ready:
                return True
            if writer.fileno() in ready or capture.ended:
                return False
            # Frames are stamped where they arrive on the bus, so taking them in batches loses nothing, and ten full
            # buses cost a few hundred wake-ups per second instead of 40 000.
            time.sleep(NAP_S)
    return False


@dataclass(frozen=True, slots=True)
class Lost:
    """Frames that were on a bus and are not in the recording."""

    in_buses: int  # dropped by the kernel or the hub: our receive buffer was full
    in_ring: int  # dropped here: the writer did not keep up

    @property
    def total(self) -> int:
        """All of them."""
        return self.in_buses + self.in_ring

    def __str__(self) -> str:
        causes = ((self.in_buses, "before the recorder, its receive buffer was full"),
                  (self.in_ring, "in the ring, the file could not be written as fast"))  # fmt: skip
        found = [f"{count} {cause}" for count, cause in causes if count]
        return f"{self.total} lost ({'; '.join(found)})" if found else "none lost"


def summary(written: Written, buses: int, elapsed_s: float, lost: Lost) -> str:
    """A recording in one line."""
    of = f"of {buses} buses " if buses > 1 else ""
    return f"{names_of(written.paths)}: {written.frames} frames {of}in {elapsed_s:.1f} s, {lost}"
