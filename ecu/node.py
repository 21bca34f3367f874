"""The ECU as a process: frames and ticks in real time around the cycle. A thin shell.

Two tasks live and die together: one waits for frames, one for the absolute timer. Missed ticks are
skipped and reported to the cycle; findings are logged as they come, and they come on changes only.
"""

import asyncio
import logging
import time
from collections.abc import Callable, Sequence
from typing import Protocol

from bus.frame import Frame
from bus.pacing import TickTiming, first_of, readable, reading
from bus.ticks import Ticks
from bus.transport import BusClosed, Transport
from bus.trouble_log import TroubleLog
from ecu.core import Ecu
from ecu.findings import Finding
from ecu.outputs import TICK_NS

log = logging.getLogger(__name__)


class BusService(Protocol):
    """What the ECU offers on the bus beside its cycle, such as measuring and calibrating."""

    def receive(self, frame: Frame, now_ns: int) -> Sequence[Frame]:
        """Look at one frame; the frames to answer it with at once."""

    def before_cycle(self, now_ns: int) -> None:
        """A cycle begins: what it shall work with is taken over here and nowhere else."""

    def after_cycle(self, now_ns: int) -> Sequence[Frame]:
        """The cycle is over and its frames are sent: further frames to send."""

    def may_send(self) -> bool:
        """Whether the ECU and its other services may send; without an address of its own it may not."""


def log_finding(finding: Finding) -> None:
    """One line per finding."""
    log.warning("%s", finding)


async def run(
    bus: Transport,
    cycle: Ecu,
    *,
    period_ns: int = TICK_NS,
    found: Callable[[Finding], None] = log_finding,
    timing: TickTiming | None = None,
    ticked: Callable[[], None] = lambda: None,
    services: Sequence[BusService] = (),
) -> None:
    """Run the cycle on the bus until the task is cancelled; BusClosed when the bus is gone.

    period_ns: real time between ticks. timing: records every tick. ticked: called after each tick, for a watchdog.
    services: what else answers on the bus; their work counts as the cycle's.
    """
    timing = timing if timing is not None else TickTiming()
    cycle.warm_up()

    trouble = TroubleLog()

    def send(frames: Sequence[Frame], by: BusService | None = None) -> None:
        if frames and all(service is by or service.may_send() for service in services):
            for frame in frames:
                bus.send(frame)

    def receive() -> None:
        while frames := bus.drain():
            for frame in frames:
                for finding in cycle.receive(frame, frame.at_ns or time.monotonic_ns()):
                    found(finding)
                for service in services:
                    send(service.receive(frame, frame.at_ns or time.monotonic_ns()), service)
        trouble.log(bus.findings())

    def tick(due_ns: int) -> None:
        started_ns = time.monotonic_ns()
        receive()  # what has come is used now, not a tick later
        for service in services:
            service.before_cycle(due_ns)
        result = cycle.tick(due_ns)  # not when it started: periods and delays then do not depend on the host
        send(result.frames)
        for finding in result.findings:
            found(finding)
        for service in services:
            send(service.after_cycle(due_ns), service)
        ended_ns = time.monotonic_ns()
        cycle.executed(ended_ns - started_ns)
        timing.add(due_ns, started_ns, ended_ns)
        ticked()

    async def pace() -> None:
        with Ticks(period_ns) as ticks:
            while True:
                await readable(ticks.fileno())
                skipped = max(ticks.expired() - 1, 0)
                if skipped:
                    timing.missed += skipped
                    cycle.overran(skipped)
                tick(ticks.due_ns)

    try:
        async with asyncio.TaskGroup() as group:
            group.create_task(reading(bus.fileno(), receive), name="ecu-listen")
            group.create_task(pace(), name="ecu-tick")
    except BaseExceptionGroup as errors:
        closed, others = errors.split(BusClosed)
        if closed is None or others is not None:
            raise
        raise first_of(closed) from None
