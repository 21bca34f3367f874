"""Plant and ECU of a lockstep run as processes that can be killed and started again."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from bus.frame import Frame
from hil.faults.passage import Action
from hil.lockstep import EcuSide, EcuTick, PlantSide


@dataclass(frozen=True, slots=True)
class Silence:
    """The tick of a process that is not there."""

    frames: Sequence[Frame] = ()
    findings: Sequence[object] = ()


class RestartableEcu:
    """An ECU that hears and says nothing while it is dead; a restart is a new one that knows nothing."""

    def __init__(self, make: Callable[[], EcuSide]) -> None:
        self._make = make
        self._ecu: EcuSide | None = make()

    def act(self, kind: str) -> None:
        """kill: the process ends here and now; restart: a new one starts, if none runs."""
        if kind == "kill":
            self._ecu = None
        elif kind == "restart" and self._ecu is None:
            self._ecu = self._make()

    def receive(self, frame: Frame, now_ns: int) -> Sequence[object]:
        """What lockstep asks of an ECU."""
        return self._ecu.receive(frame, now_ns) if self._ecu is not None else ()

    def tick(self, now_ns: int) -> EcuTick:
        """What lockstep asks of an ECU."""
        return self._ecu.tick(now_ns) if self._ecu is not None else Silence()


class RestartablePlant:
    """A plant whose bus node can die: the machine rolls on, but says nothing and hears nothing."""

    def __init__(self, plant: PlantSide) -> None:
        self._plant = plant
        self._dead = False

    def act(self, kind: str) -> None:
        """kill: the node falls silent and deaf; restart: it is back."""
        if kind in ("kill", "restart"):
            self._dead = kind == "kill"

    def receive(self, frame: Frame, now_ns: int) -> Sequence[object]:
        """What lockstep asks of a plant."""
        return () if self._dead else self._plant.receive(frame, now_ns)

    def tick(self, now_ns: int) -> Sequence[Frame]:
        """What lockstep asks of a plant."""
        frames = self._plant.tick(now_ns)
        return () if self._dead else frames

    def reference_frames(self) -> Sequence[Frame]:
        """What lockstep asks of a plant; the test instrumentation has a node of its own."""
        return self._plant.reference_frames()

    @property
    def truth(self) -> Any:
        """What lockstep asks of a plant."""
        return self._plant.truth

    @property
    def finished(self) -> bool:
        """What lockstep asks of a plant."""
        return self._plant.finished


def acting_on(plant: RestartablePlant, ecu: RestartableEcu) -> Callable[[Action, int], None]:
    """What does an injector's actions to these two; bus_off and bus_on are the wire's own."""

    def act(action: Action, now_ns: int) -> None:
        (plant if action.target == "plant" else ecu).act(action.kind)

    return act
