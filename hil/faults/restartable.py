"""Wraps plant and ECU of a lockstep run so that a fault can kill and restart them like processes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from bus.frame import Frame
from hil.faults.passage import Action
from hil.lockstep import EcuSide, EcuTick, PlantSide


@dataclass(frozen=True, slots=True)
class Silence:
    """The empty tick of a process that does not run."""

    frames: Sequence[Frame] = ()
    findings: Sequence[object] = ()


class RestartableEcu:
    """An ECU that neither receives nor sends while it is killed; a restart makes a new one without any state."""

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
        """As `hil.lockstep.EcuSide`."""
        return self._ecu.receive(frame, now_ns) if self._ecu is not None else ()

    def tick(self, now_ns: int) -> EcuTick:
        """As `hil.lockstep.EcuSide`."""
        return self._ecu.tick(now_ns) if self._ecu is not None else Silence()


class RestartablePlant:
    """A plant whose bus node can be killed: the machine keeps moving, but neither sends nor receives."""

    def __init__(self, plant: PlantSide) -> None:
        self._plant = plant
        self._dead = False

    def act(self, kind: str) -> None:
        """kill: the node falls silent and deaf; restart: it is back."""
        if kind in ("kill", "restart"):
            self._dead = kind == "kill"

    def receive(self, frame: Frame, now_ns: int) -> Sequence[object]:
        """As `hil.lockstep.PlantSide`."""
        return () if self._dead else self._plant.receive(frame, now_ns)

    def tick(self, now_ns: int) -> Sequence[Frame]:
        """As `hil.lockstep.PlantSide`."""
        # physics goes on without electronics
        frames = self._plant.tick(now_ns)
        return () if self._dead else frames

    def reference_of(self, truths: Sequence[Any], first: int, at_ns: int) -> Sequence[Frame]:
        """As `hil.lockstep.PlantSide`; the test instrumentation is a node of its own and is not killed."""
        return self._plant.reference_of(truths, first, at_ns)

    @property
    def truth(self) -> Any:
        """As `hil.lockstep.PlantSide`."""
        return self._plant.truth

    @property
    def finished(self) -> bool:
        """As `hil.lockstep.PlantSide`."""
        return self._plant.finished


def acting_on(plant: RestartablePlant, ecu: RestartableEcu) -> Callable[[Action, int], None]:
    """A function that carries out an injector's actions on these two; bus_off and bus_on are handled by the wire."""

    def act(action: Action, now_ns: int) -> None:
        # lockstep has no processes: the two objects are their stand-ins
        (plant if action.target == "plant" else ecu).act(action.kind)

    return act
