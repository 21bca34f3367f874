"""Sources of frames for the monitor: one interface for buses, recordings and logs that still grow."""

import select
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import NamedTuple, Protocol

from bus.address import open_transport
from bus.closing import Closing
from bus.errors import Fault
from bus.frame import LOCAL, Frame
from bus.socketcan import wallclock
from bus.socketcan.link import Link, can_interfaces
from bus.socketcan.transport import SocketCanTransport
from bus.ticks import Alarm
from bus.transport import BusClosed, BusUnavailable, Transport
from hil.monitor.target import ANY, Target
from hil.shell.process import Stop

Seen = tuple[str, Frame]
"""A frame and the name of the interface it was seen on."""
_LINK = (Fault.LINK_DOWN, Fault.LINK_UP, Fault.LINK_GONE)
_ROUNDS = 16
"""Drains before a batch is handed on: a monitor that is behind catches up in larger batches."""


class Batch(NamedTuple):
    """Frames in the order of their stamps, oldest first."""

    frames: list[Seen]  # empty when only time has passed
    ahead_ns: int  # add to the stamps for nanoseconds since 1970


class Source(Protocol):
    """Frames to be shown."""

    names: tuple[str, ...]

    def batches(self, stop: Stop, every_s: float) -> Iterator[Batch]:
        """Batches as they come, and an empty one at least every `every_s` seconds while none do, until the end.

        The end is that of a recording, or the signal that `stop` waits for.
        """

    def lost(self) -> dict[str, int]:
        """Frames lost by interface, because they came too fast."""

    def warnings(self) -> list[str]:
        """Other problems, and their ends, since the last call; one line each."""

    def now_ns(self) -> int:
        """The time now on the clock of the stamps."""


class Buses(Closing):
    """One or several buses, watched together until the signal."""

    def __init__(
        self,
        targets: Sequence[Target],
        *,
        origins: bool = False,
        watch: Sequence[int] = (),
        client: str = "monitor",
    ) -> None:
        """client: what a hub calls us in its list.

        origins: frames sent from this machine (on a hub all of them) carry the flag LOCAL.

        watch: descriptors whose hang-up ends it too (the reader of our output has gone).
        BusUnavailable if one of the buses cannot be opened.
        """
        self.names = tuple(target.name for target in targets)
        self._stack = ExitStack()
        self._epoll = self._stack.enter_context(select.epoll())
        self._watched = set(watch)
        self._origins = origins
        for descriptor in watch:
            # no events asked for: hang-up and error are always reported
            self._epoll.register(descriptor, 0)
        self._buses: list[tuple[Target, Transport]] = []
        try:
            for target in _expanded(targets):
                transport = self._stack.enter_context(_open(target, client, origins=origins))
                self._epoll.register(transport.fileno(), select.EPOLLIN)
                self._buses.append((target, transport))
        except BaseException:
            self.close()
            raise

    def batches(self, stop: Stop, every_s: float) -> Iterator[Batch]:
        """As the protocol has it; BusClosed after the last frame of a bus that has ended."""
        every_ns = round(every_s * 1e9)
        alarm = Alarm()
        self._stack.callback(alarm.close)
        self._epoll.register(alarm.fileno(), select.EPOLLIN)
        alarm.set(time.monotonic_ns() + every_ns)
        for _ in stop.readable(self._epoll.fileno()):
            # the reader has gone: nobody would see further output
            if self._watched & {number for number, _ in self._epoll.poll(0)}:
                return
            # empties the buses before it waits again: under load this makes batches, and a batch costs less per frame
            while len(frames := self.drain()) > 0:
                yield Batch(frames, wallclock.SHARED.ahead_ns)
            now_ns = time.monotonic_ns()
            yield Batch([], wallclock.SHARED.ahead_ns)
            alarm.set(now_ns + every_ns)

    def fileno(self) -> int:
        """Readable when `drain` has frames to give."""
        return self._epoll.fileno()

    def drain(self) -> list[Seen]:
        """The frames that have arrived, at most _ROUNDS drains per bus; sorted by time when several buses are watched.

        BusClosed when a bus has ended and everything that arrived has been given.
        """
        wallclock.SHARED.check()
        frames: list[Seen] = []
        for target, transport in self._buses:
            passes, name = target.filters.passes, target.name
            try:
                for _ in range(_ROUNDS):
                    if not (drained := transport.drain()):
                        break
                    if self._origins and not target.interface:
                        drained = [frame._replace(flags=frame.flags | LOCAL) for frame in drained]
                    frames += [(name, frame) for frame in drained if passes(frame.can_id)]
            except BusClosed:
                if not frames:
                    raise
        if len(self._buses) > 1:
            frames.sort(key=lambda seen: seen[1].at_ns)
        return frames

    def lost(self) -> dict[str, int]:
        """As the protocol has it."""
        return {target.name: transport.statistics().dropped_in for target, transport in self._buses}

    def warnings(self) -> list[str]:
        """Interfaces that went down or came back."""
        return [
            f"{target.name}: {finding.fault}"
            for target, transport in self._buses
            for finding in transport.findings()
            if finding.fault in _LINK
        ]

    def now_ns(self) -> int:
        """The monotonic clock."""
        return time.monotonic_ns()

    def close(self) -> None:
        """Leave the buses; a second call does nothing."""
        self._stack.close()


def _expanded(targets: Sequence[Target]) -> list[Target]:
    """`any` replaced by the CAN interfaces that are up."""
    every: list[Target] = []
    for target in targets:
        if target.interface != ANY:
            every.append(target)
            continue
        names = [name for name in can_interfaces() if (link := Link.read(name)) is not None and link.up]
        if not names:
            raise BusUnavailable("any: no CAN interface is up on this machine")
        every += [replace(target, name=name, address=f"socketcan:{name}") for name in names]
    return every


def _open(target: Target, client: str, *, origins: bool) -> Transport:
    """The bus of a target; on an interface the kernel filters where it can."""
    if not target.interface:
        return open_transport(target.address, name=client)
    # joined filters are applied by us: the kernel can join them too, but then not together with error frames
    pairs = None if target.filters.joined else target.filters.pairs or None
    return SocketCanTransport(target.interface, filters=pairs, origins=origins)


def signalled(stop: Stop, timeout_s: float = 0.0) -> bool:
    """Whether the signal to end has come, waiting for it for at most that long."""
    return bool(select.select([stop], [], [], timeout_s)[0])
