"""The gateway on two transports, in real time: a thin loop around the core.

Plain epoll, as in the hub: a relay is a few system calls and little else. A bus that does not accept a
frame is tried again a millisecond later; meanwhile the other direction continues.
"""

import logging
import select
import time
from collections.abc import Callable

from bus.closing import Closing
from bus.errors import BusFinding
from bus.ticks import Alarm
from bus.transport import Transport
from hil.gateway.core import GatewayCore
from hil.gateway.findings import Finding
from hil.gateway.injection import Action
from hil.gateway.routes import OTHER, SIDES, Side

RETRY_NS = 1_000_000
"""How long to wait before offering frames again to a bus that took none."""

log = logging.getLogger(__name__)


def log_finding(side: Side, finding: Finding | BusFinding) -> None:
    """One line per finding."""
    log.warning("%s", finding if isinstance(finding, Finding) else f"{side} side: {finding}")


class GatewayLoop(Closing):
    """Serves two transports. Wait on `fileno`, then call `serve`; neither blocks.

    The run begins with the first frame from the plant.
    """

    def __init__(
        self,
        core: GatewayCore,
        transports: dict[Side, Transport],
        *,
        found: Callable[[Side, Finding | BusFinding], None] = log_finding,
        act: Callable[[Action], None] | None = None,
        passed: Callable[[int], None] | None = None,
    ) -> None:
        """found: called with every finding; act: does what the core cannot do (kill a process).

        passed: called for every frame with its time in the gateway, from the stamp of its bus to its sending [ns].
        """
        self._core = core
        self._transports = transports
        self._found = found
        self._act = act
        self._passed = passed
        self._alarm = Alarm()
        self._epoll = select.epoll()
        for transport in transports.values():
            self._epoll.register(transport.fileno(), select.EPOLLIN)
        self._epoll.register(self._alarm.fileno(), select.EPOLLIN)

    def fileno(self) -> int:
        """Readable when there is something to do."""
        return self._epoll.fileno()

    def serve(self) -> bool:
        """Take at most one batch from either side, and send what the buses accept; returns whether any frame came.

        BusClosed when one of the buses is gone.
        """
        core = self._core
        came = False
        for side in SIDES:
            frames = self._transports[side].drain()
            if frames:
                came, now_ns = True, time.monotonic_ns()
                # times of a fault script count from the machine's first frame: before it, everybody waits for the plant
                if side == "plant" and core.started_ns is None:
                    core.start(now_ns)
                core.receive(side, frames, now_ns)
                # at once, before the other side is read: this is the latency of the gateway
                self._send(OTHER[side])
            else:
                core.nothing_came(side, time.monotonic_ns())
        now_ns = time.monotonic_ns()
        for action in core.advance(now_ns):
            if self._act is not None:
                self._act(action)
        waiting = [self._send(side) for side in SIDES]
        due_ns = core.next_ns()
        # POLLOUT would not do: a full queue of a CAN interface is no full socket buffer
        if any(waiting):
            due_ns = min(now_ns + RETRY_NS, due_ns or now_ns + RETRY_NS)
        self._alarm.set(due_ns)
        self._report()
        return came

    def _send(self, side: Side) -> bool:
        """Send the frames that wait for a bus; returns whether some still wait."""
        queue, counts = self._core.waiting(side), self._core.counts[side]
        send, passed, now = self._transports[side].send, self._passed, time.monotonic_ns
        while queue:
            frame = queue[0]
            if not send(frame):
                counts.held += 1
                return True
            # removed only after the bus has accepted it: a refused frame is offered again, in its place
            queue.popleft()
            counts.sent += 1
            if passed is not None and frame.at_ns:
                passed(now() - frame.at_ns)
        return False

    def _report(self) -> None:
        for finding in self._core.findings():
            self._found(finding.side, finding)
        for side, transport in self._transports.items():
            for trouble in transport.findings():
                self._found(side, trouble)

    def close(self) -> None:
        """Release what the loop made; the transports stay open."""
        self._epoll.close()
        self._alarm.close()
