"""A machine that drives on a CAN interface, and a record of the limits that it obeys at each of its ticks."""

import asyncio
import contextlib
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from bus.socketcan.transport import SocketCanTransport
from hil.compose import Choice, plant_unit
from plant import node
from plant.unit.limits import Limits
from plant.unit.unit import PlantUnit

SCENARIO = """
name = "on_the_way"
sentence = "Straight ahead at 14 km/h, faster than the machine's own safe limit."
duration_s = 3000.0
machine = "l60"
seed = 17

[start]
speed_kmh = 14.0

[driver.speed_kmh]
points = [[0.0, 14.0]]

[driver.articulation_deg]
points = [[0.0, 0.0]]
"""
PATIENCE_S = 120.0


@dataclass(frozen=True, slots=True)
class Tick:
    """One tick of the machine."""

    at_ns: int
    safe: bool  # whether limits no weaker than the safe ones were in force
    speed: float  # over ground [m/s]
    limits_age_s: float  # since the last good Limits frame


def no_weaker(limits: Limits, than: Limits) -> bool:
    """Whether limits permit nothing that others forbid. An ECU's own safe limits differ from the machine's by what a signal resolves."""
    pairs = zip(
        (limits.speed, limits.articulation_rate, *limits.wheel_torque),
        (than.speed, than.articulation_rate, *than.wheel_torque),
        strict=True,
    )
    return all(limit <= other * 1.01 for limit, other in pairs)


class DrivingMachine:
    """The machine's unit on an interface, in a thread of its own."""

    def __init__(self, interface: str, folder: Path) -> None:
        file = folder / "on_the_way.toml"
        file.write_text(SCENARIO)
        scenario = Choice(scenario=str(file)).load()
        self.unit: PlantUnit = plant_unit(scenario)
        self.obedience = scenario.equipment.obedience
        # compiles on a unit of its own, so that the first real tick is like every other
        plant_unit(scenario).tick(0)
        self.ticks: list[Tick] = []
        self._bus = SocketCanTransport(interface)
        self._stop = threading.Event()
        self._task: asyncio.Task[None] | None = None
        self._thread = threading.Thread(target=self._run, name="machine", daemon=True)

    def __enter__(self) -> Self:
        self.started_ns = time.monotonic_ns()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(PATIENCE_S)
        self._bus.close()

    def _run(self) -> None:
        async def driving() -> None:
            self._task = asyncio.current_task()
            await node.run(self._bus, self.unit, on_tick=self._ticked)

        with contextlib.suppress(asyncio.CancelledError):
            asyncio.run(driving())

    def _ticked(self, unit: PlantUnit) -> None:
        if self._stop.is_set() and self._task is not None:
            self._task.cancel()
        now_ns = time.monotonic_ns()
        self.ticks.append(
            Tick(
                now_ns,
                no_weaker(unit.limits_in_force(now_ns), self.obedience.safe),
                abs(unit.truth.speed),
                (now_ns - unit.reception.limits_ns) * 1e-9,
            )
        )

    def wait(
        self, condition: Callable[[Tick], bool], what: str, *, hold: int = 1, patience_s: float = PATIENCE_S
    ) -> Tick:
        """The first new tick that ends `hold` ticks in a row for which the condition holds. TimeoutError otherwise."""
        at, held, end = len(self.ticks), 0, time.monotonic() + patience_s
        while time.monotonic() < end:
            while at < len(self.ticks):
                tick = self.ticks[at]
                held = held + 1 if condition(tick) else 0
                if held >= hold:
                    return tick
                at += 1
            time.sleep(0.002)
        raise TimeoutError(f"{what}: not within {patience_s:g} s; last: {self.ticks[-1:]}")

    def after(self, event_ns: int) -> list[Tick]:
        """The ticks after an event."""
        return [tick for tick in self.ticks if tick.at_ns > event_ns]
