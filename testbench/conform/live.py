"""A conformance test on a real bus: the thin shell around `Session`."""

import contextlib
import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from bus.address import inside_computer, open_transport
from bus.bounded_json import read_object
from bus.ticks import Alarm
from bus.transport import Transport
from dbc.recordings.writer import CandumpWriter
from hil import rundir
from hil.rundir import writing
from hil.shell.process import Stop
from testbench.conform.evidence import Bench, ConformError
from testbench.conform.session import Session

NS = 1_000_000_000
# A fifth of the shortest cycle time of the inputs (10 ms): a stimulus later than this is a late input.
LATE_NS = 2_000_000
BENCH = "bench.json"
"""File beside the record: what is known of the bench that made it."""
LARGEST_BENCH = 1 << 16  # bytes of that file; ours has some hundred


@dataclass(frozen=True, slots=True)
class Watched:
    """How the test itself went. ended: came, absent or interrupted."""

    ended: str
    bench: Bench


def watch(
    address: str,
    make: Callable[[int], Session],
    *,
    wait_s: float,
    notify: Callable[[str], None],
) -> tuple[Session, Watched]:
    """Run a session to its end. make: the session that starts at a time [ns]; notify: gets each phase in words."""
    with (
        open_transport(address, name="conform") as bus,
        Stop() as stop,
        contextlib.closing(Alarm()) as alarm,
    ):
        session = make(time.monotonic_ns())
        notify(f"waiting for {session.node} on {address}, at most {wait_s:g} s: switch it on now")
        deadline_ns = session.start_ns + round(wait_s * NS)
        wake_ns, phase, ended = session.start_ns, session.phase, "interrupted"
        lateness = []
        # 1 ns after boot: at once. 0 would disarm the timer.
        alarm.set(1)
        for _ in stop.readable(alarm.fileno(), bus.fileno()):
            now_ns = time.monotonic_ns()
            # before the node is there nothing is due, and lateness would only count the first wake-up
            if session.phase != "waiting":
                lateness.append(now_ns - wake_ns)
            _exchange(session, bus, now_ns)
            if session.phase != phase:
                phase = session.phase
                notify(f"{(now_ns - session.start_ns) / NS:6.2f} s  {phase}")
            if session.finished or (session.first_ns is None and now_ns > deadline_ns):
                ended = "came" if session.finished else "absent"
                break
            wake_ns = session.next_ns(now_ns)
            alarm.set(wake_ns)
        # frames that we failed to send are as good as lost: the node did not get its input
        lost = bus.statistics().dropped_in + bus.statistics().dropped_out
        late = sum(each > LATE_NS for each in lateness)
        bench = Bench(
            from_start=session.from_start,
            dropped=lost,
            late_ns=max(lateness, default=0),
            late_share=late / max(len(lateness), 1),
            shared_host=inside_computer(address),
        )
        return session, Watched(ended, bench)


def _exchange(session: Session, bus: Transport, now_ns: int) -> None:
    """Everything that came into the session, everything that is due onto the bus."""
    while frames := bus.drain():
        session.receive(frames, now_ns)
    for frame in session.advance(now_ns):
        bus.send(frame)


def keep(session: Session, bench: Bench, folder: Path) -> None:
    """The record as a candump log, and what is known of the bench, so that every verdict can be looked up and repeated."""
    file = folder / rundir.BUS
    with writing(file):
        folder.mkdir(parents=True, exist_ok=True)
        with CandumpWriter(file) as log:
            # kernel stamps of received frames are older than our own of those sent meanwhile
            for frame in sorted(session.record, key=lambda frame: frame.at_ns):
                log.write(frame, "bus")
        (folder / BENCH).write_text(json.dumps(asdict(bench), indent=2) + "\n")


def kept_bench(folder: Path) -> Bench:
    """What `keep` wrote of the bench; a bench of which nothing is known where the file is missing."""
    file = folder / BENCH
    # a record of `loaderhil record` can be judged too; it has no such file
    if not file.exists():
        return Bench()
    try:
        return Bench(**read_object(file.read_bytes(), LARGEST_BENCH))
    except (OSError, ValueError, TypeError) as error:
        raise ConformError(f"{file}: not what `loaderhil conform` writes: {error}") from None
