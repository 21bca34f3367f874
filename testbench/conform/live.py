"""A conformance test on a real bus: the thin shell around `Session`."""

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from bus.address import open_transport
from bus.ticks import Alarm
from bus.transport import Transport
from dbc.recordings.writer import CandumpWriter
from hil.rundir import writing
from hil.shell.process import Stop
from testbench.conform.session import Session

NS = 1_000_000_000
LATE_NS = 2_000_000


@dataclass(frozen=True, slots=True)
class Watched:
    """How the test itself went. ended: came, absent or interrupted; dropped: frames lost; late_ns: largest own lateness.

    late_share: of its wake-ups, those that were later than 2 ms.
    """

    ended: str
    dropped: int
    late_ns: int
    late_share: float


def watch(
    address: str,
    make: Callable[[int], Session],
    *,
    wait_s: float,
    told: Callable[[str], None],
) -> tuple[Session, Watched]:
    """Run a session to its end. make: the session that starts at a time [ns]; told: hears each phase in words."""
    with (
        open_transport(address, name="conform") as bus,
        Stop() as stop,
        contextlib.closing(Alarm()) as alarm,
    ):
        session = make(time.monotonic_ns())
        told(f"waiting for {session.node} on {address}, at most {wait_s:g} s: switch it on now")
        deadline_ns = session.start_ns + round(wait_s * NS)
        wake_ns, phase, ended = session.start_ns, session.phase, "interrupted"
        lateness = []
        alarm.set(1)
        for _ in stop.readable(alarm.fileno(), bus.fileno()):
            now_ns = time.monotonic_ns()
            if session.phase != "waiting":
                lateness.append(now_ns - wake_ns)
            _exchange(session, bus, now_ns)
            if session.phase != phase:
                phase = session.phase
                told(f"{(now_ns - session.start_ns) / NS:6.2f} s  {phase}")
            if session.finished or (session.first_ns is None and now_ns > deadline_ns):
                ended = "came" if session.finished else "absent"
                break
            wake_ns = session.next_ns(now_ns)
            alarm.set(wake_ns)
        lost = bus.statistics().dropped_in + bus.statistics().dropped_out
        late = sum(each > LATE_NS for each in lateness)
        return session, Watched(ended, lost, max(lateness, default=0), late / max(len(lateness), 1))


def _exchange(session: Session, bus: Transport, now_ns: int) -> None:
    """Everything that came into the session, everything that is due onto the bus."""
    while frames := bus.drain():
        session.receive(frames, now_ns)
    for frame in session.advance(now_ns):
        bus.send(frame)


def keep(session: Session, file: Path) -> None:
    """The record as a candump log, so that every verdict can be looked up and repeated."""
    with writing(file):
        file.parent.mkdir(parents=True, exist_ok=True)
        with CandumpWriter(file) as log:
            for frame in sorted(session.record, key=lambda frame: frame.at_ns):
                log.write(frame, "bus")
