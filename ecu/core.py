"""What bench, process and campaigns need of an ECU, whatever its core is written in.

A *core* makes ECUs: `PYTHON` here, the exported C in `deploy.c.core`. Whoever builds a run takes a core as an argument, so that
nothing below the command line asks which one it is.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from bus.frame import Frame
from ecu.calibration import Calibration
from ecu.cycle import EcuCycle, Form
from ecu.findings import Finding

__all__ = ["PYTHON", "Answer", "Core", "Ecu", "Form", "PythonCore"]


class Answer(Protocol):
    """The result of one tick."""

    @property
    def frames(self) -> Sequence[Frame]:
        """To send, in this order."""
        ...

    @property
    def findings(self) -> Sequence[Finding]:
        """To log."""
        ...


class Ecu(Protocol):
    """One ECU: the interface of `ecu.cycle.EcuCycle`. Times are of one monotonic clock [ns]."""

    def warm_up(self) -> None:
        """Make the first tick as fast as the others."""
        ...

    def receive(self, frame: Frame, now_ns: int) -> Sequence[Finding]:
        """Take one frame from the bus."""
        ...

    def tick(self, now_ns: int) -> Answer:
        """One cycle."""
        ...

    def executed(self, execution_ns: int) -> None:
        """The last tick took this long."""
        ...

    def overran(self, skipped: int) -> None:
        """The shell had to skip ticks."""
        ...


class Core(Protocol):
    """Makes ECUs. Picklable, because campaigns hand it to their processes."""

    @property
    def name(self) -> str:
        """As the command line has it."""
        ...

    def computing(self, calibration: Calibration, form: Form) -> str:
        """As run.json has it: the name of what computes such an ECU. Another than `name` for a core that chooses between others."""
        return self.name

    def ecu(
        self,
        calibration: Calibration,
        *,
        form: Form = "corrected",
        limits: bool = True,
        detect_faults: bool = False,
    ) -> Ecu:
        """A fresh ECU, independent of all others. UserError for what this core does not have.

        form: equations of the estimators; limits: whether it limits the machine; detect_faults: whether sensors are tested against each other.
        """
        ...


@dataclass(frozen=True, slots=True)
class PythonCore(Core):
    """`ecu.cycle.EcuCycle` with compiled estimators."""

    name: str = "python"

    def ecu(
        self,
        calibration: Calibration,
        *,
        form: Form = "corrected",
        limits: bool = True,
        detect_faults: bool = False,
    ) -> EcuCycle:
        """As `Core.ecu`."""
        return EcuCycle(calibration, form=form, limits_enabled=limits, detect_faults=detect_faults)


PYTHON = PythonCore()
