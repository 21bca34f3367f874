"""The machine as a process: ticks and frames in real time around the unit. A thin shell.

Two tasks live and die together: one waits for frames, one for the absolute timer. Missed ticks are
skipped and counted: the machine's own time then falls behind the clock, it never bursts.
"""

import asyncio
import time
from collections.abc import Callable
from pathlib import Path

from bus.pacing import TickTiming, first_of, readable, reading
from bus.ticks import Ticks
from bus.transport import BusClosed, Transport
from bus.trouble_log import TroubleLog
from plant.recorder import TruthRecorder
from plant.unit.reception import Finding
from plant.unit.unit import TICK_NS, PlantUnit


async def run(
    transport: Transport,
    unit: PlantUnit,
    *,
    period_ns: int = TICK_NS,
    realtime: bool = True,
    on_tick: Callable[[PlantUnit], None] | None = None,
    on_finding: Callable[[Finding], None] | None = None,
    timing: TickTiming | None = None,
    truth_path: Path | None = None,
) -> None:
    """Run the unit on the bus until it has finished or the task is cancelled.

    period_ns: real time between ticks; each advances the machine by its own 10 ms.
    realtime: False ticks as fast as the loop permits, for tests.
    on_tick: called with the unit after each tick.
    truth_path: where the true motion is written at the end, however it comes: finished,
    cancelled, or BusClosed, which is raised to the caller when the hub or interface is gone.
    """
    truth = TruthRecorder(truth_path) if truth_path else None
    timing = timing or TickTiming()
    trouble = TroubleLog()

    def receive() -> None:
        while frames := transport.drain():
            for frame in frames:
                for finding in unit.receive(frame, frame.at_ns or time.monotonic_ns()):
                    if on_finding:
                        on_finding(finding)
        trouble.log(transport.findings())

    def tick(due_ns: int) -> None:
        started_ns = time.monotonic_ns()
        receive()  # what has come is used now, not a tick later
        frames = unit.tick(started_ns)
        for frame in frames:
            transport.send(frame)
        timing.add(due_ns, started_ns, time.monotonic_ns())
        if truth is not None:
            truth.append(unit.truth)
        if on_tick:
            on_tick(unit)

    async def pace() -> None:
        with Ticks(period_ns) as ticks:
            while not unit.finished:
                await readable(ticks.fileno())
                timing.missed += max(ticks.expired() - 1, 0)
                tick(ticks.due_ns)

    async def hurry() -> None:
        while not unit.finished:
            tick(time.monotonic_ns())
            await asyncio.sleep(0)

    try:
        async with asyncio.TaskGroup() as group:
            listener = group.create_task(reading(transport.fileno(), receive), name="plant-listen")
            await (pace() if realtime else hurry())
            listener.cancel()
    except BaseExceptionGroup as errors:
        closed, others = errors.split(BusClosed)
        if closed is None or others is not None:
            raise
        raise first_of(closed) from None
    finally:
        if truth is not None:
            with truth:
                truth.save()
