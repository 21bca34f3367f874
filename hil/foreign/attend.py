"""The process that attends a foreign node: waits for its first frame, reports its silences, and times a run against a foreign machine."""

import selectors
import time
from dataclasses import dataclass

from bus.address import open_transport
from bus.ticks import Ticks
from bus.transport import Transport
from dbc import loader_database
from hil.ending import Ending
from hil.foreign.silence import SILENT_NS, identifiers_of
from hil.shell.lifeline import Lifeline
from hil.shell.process import Stop

# Half of SILENT_NS, so that a silence is reported at most 50 ms after it counts as one.
LOOK_NS = 50_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Post:
    """The node to attend."""

    node: str  # of the DBC
    address: str  # of its bus
    wait_s: float  # longest wait for the first frame [s]
    duration_s: float | None = None  # the run ends this time after `go` [s]; None: another process ends it


class _Hearing:
    """The times of the node's first and last frame, and the identifiers of other senders."""

    def __init__(self, node: str) -> None:
        self._own = identifiers_of(node, loader_database())
        self.first_ns: int | None = None
        self.last_ns = 0
        self.others: set[int] = set()

    def take(self, bus: Transport) -> None:
        """Read what has come."""
        while frames := bus.drain():
            for frame in frames:
                if frame.can_id in self._own:
                    self.last_ns = frame.at_ns or time.monotonic_ns()
                    self.first_ns = self.first_ns or self.last_ns
                else:
                    self.others.add(frame.can_id)


def run(line: Lifeline, post: Post) -> Ending:
    """Attend a node until its time is over or the supervisor ends this process; PEER_DIED if the node never came."""
    hearing = _Hearing(post.node)
    with open_transport(post.address, name="attend") as bus, Stop() as stop, Ticks(LOOK_NS) as ticks:
        line.note(f"waiting for {post.node} on {post.address}, at most {post.wait_s:g} s")
        deadline_ns = time.monotonic_ns() + round(post.wait_s * 1e9)
        for _ in stop.readable(bus.fileno(), ticks.fileno()):
            ticks.expired()
            hearing.take(bus)
            if hearing.first_ns is not None:
                break
            if time.monotonic_ns() > deadline_ns:
                line.error(_nobody(post, len(hearing.others)))
                return Ending.PEER_DIED
        if hearing.first_ns is None:
            return Ending.INTERRUPTED
        line.note(f"{post.node} is there")
        line.ready()
        return _attend(line, post, bus, hearing, stop, ticks)


def _nobody(post: Post, others: int) -> str:
    heard = f"{others} other identifiers were heard" if others else "the bus was silent"
    return (
        f"{post.node} sent none of its messages on {post.address} within {post.wait_s:g} s ({heard}): "
        "is it powered, on this bus, at this bit rate, and does it send before it hears the other side? (--wait-s)"
    )


def _attend(
    line: Lifeline, post: Post, bus: Transport, hearing: _Hearing, stop: Stop, ticks: Ticks
) -> Ending:
    """Report the begin and the end of each silence, until the run ends."""
    zero_ns = _wait_for_go(line, bus, hearing)
    end_ns = None if post.duration_s is None else zero_ns + round(post.duration_s * 1e9)
    silent = False
    complete = end_ns is None
    for _ in stop.readable(bus.fileno(), ticks.fileno()):
        ticks.expired()
        hearing.take(bus)
        now_ns = time.monotonic_ns()
        if silent is not (now_ns - max(hearing.last_ns, zero_ns) > SILENT_NS):
            silent = not silent
            at_s = ((hearing.last_ns if silent else now_ns) - zero_ns) * 1e-9
            line.note(f"{post.node} {'fell silent' if silent else 'is back'} at {at_s:.2f} s")
        if post.duration_s is not None:
            line.progress((now_ns - zero_ns) * 1e-9, post.duration_s)
        if end_ns is not None and now_ns >= end_ns:
            complete = True
            break
    elapsed_s = (time.monotonic_ns() - zero_ns) * 1e-9
    line.finished(complete=complete, zero_ns=zero_ns, duration_s=elapsed_s)
    return Ending.PASSED


def _wait_for_go(line: Lifeline, bus: Transport, hearing: _Hearing) -> int:
    """The time of go [ns]; the bus is read meanwhile, so that the receive buffer does not overflow."""
    if not line.supervised:
        return time.monotonic_ns()
    with selectors.DefaultSelector() as selector:
        selector.register(line.fileno(), selectors.EVENT_READ, "line")
        selector.register(bus.fileno(), selectors.EVENT_READ, "bus")
        while True:
            ready = {key.data for key, _ in selector.select()}
            hearing.take(bus)
            if "line" in ready:
                line.wait_for_go()
                return time.monotonic_ns()
