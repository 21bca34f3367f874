"""Both cores of the ECU in one run: Python and C on the same frames, compared at every call. A difference ends the run."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from bus.frame import Frame
from dbc import loader_database
from deploy.c.core import C
from ecu.calibration import Calibration
from ecu.core import PYTHON, Answer, Core, Ecu, Form
from ecu.findings import EstimatorFailed, Finding
from hil.lockstep import CutOffError


class CoresDifferError(CutOffError):
    """The two cores gave different answers; the message names the cycle, the message and the signal."""


class BothEcus:
    """Two ECUs that get the same frames. As `ecu.core.Ecu`; the answers are those of Python, as long as both agree."""

    def __init__(self, python: Ecu, c: Ecu) -> None:
        self._python, self._c = python, c
        self._cycle = 0

    def warm_up(self) -> None:
        """As `ecu.core.Ecu`."""
        self._python.warm_up()

    def receive(self, frame: Frame, now_ns: int) -> Sequence[Finding]:
        """As `ecu.core.Ecu`."""
        found = self._python.receive(frame, now_ns)
        self._compare_findings(found, self._c.receive(frame, now_ns))
        return found

    def tick(self, now_ns: int) -> Answer:
        """As `ecu.core.Ecu`."""
        ours, theirs = self._python.tick(now_ns), self._c.tick(now_ns)
        self._compare_findings(ours.findings, theirs.findings)
        if (difference := first_difference(ours.frames, theirs.frames)) is not None:
            raise CoresDifferError(f"cycle {self._cycle}, {difference}")
        self._cycle += 1
        return ours

    def executed(self, execution_ns: int) -> None:
        """As `ecu.core.Ecu`: the same time for both, because it is sent in a frame."""
        self._python.executed(execution_ns)
        self._c.executed(execution_ns)

    def overran(self, skipped: int) -> None:
        """As `ecu.core.Ecu`."""
        self._python.overran(skipped)
        self._c.overran(skipped)

    def _compare_findings(self, ours: Sequence[Finding], theirs: Sequence[Finding]) -> None:
        expected, found = ([_text(finding) for finding in each] for each in (ours, theirs))
        if expected != found:
            pairs = zip([*expected, "nothing"], [*found, "nothing"], strict=False)
            here, there = next((a, b) for a, b in pairs if a != b)
            raise CoresDifferError(f"cycle {self._cycle}: Python finds {here}, C {there}")


def _text(finding: Finding) -> str:
    """A finding as text, by which one with a value that is no number equals itself; C has no words for what failed."""
    return "EstimatorFailed" if isinstance(finding, EstimatorFailed) else str(finding)


def first_difference(ours: Sequence[Frame], theirs: Sequence[Frame]) -> str | None:
    """The first message and signal in which two answers differ; None where they are the same frames in the same order."""
    codecs = loader_database().by_id
    for a, b in zip(ours, theirs, strict=False):
        if a.can_id != b.can_id:
            return f"Python sends {codecs[a.can_id].name} where C sends {codecs[b.can_id].name}"
        if a.data != b.data:
            return _signals(a, b)
    if len(ours) != len(theirs):
        return f"Python sends {len(ours)} frames, C {len(theirs)}"
    return None


def _signals(ours: Frame, theirs: Frame) -> str:
    """The first signal in which two frames of one message differ, counters and checksums last."""
    codec = loader_database().by_id[ours.can_id]
    if len(ours.data) != len(theirs.data):
        return f"{codec.name}: Python sends {len(ours.data)} bytes, C {len(theirs.data)}"
    pairs = codec.decode_dict(ours.data), codec.decode_dict(theirs.data)
    # a checksum differs with every other signal, and says nothing then
    names = sorted(pairs[0], key=lambda name: name in ("Crc", "AliveCounter"))
    for name in names:
        a, b = (values[name] for values in pairs)
        if str(a) != str(b):
            return f"{codec.name}.{name}: Python {a}, C {b}"
    return f"{codec.name}: Python {ours.data.hex()}, C {theirs.data.hex()}"


@dataclass(frozen=True, slots=True)
class BothCores(Core):
    """As `ecu.core.Core`."""

    name: str = "both"

    def ecu(
        self,
        calibration: Calibration,
        *,
        form: Form = "corrected",
        limits: bool = True,
        detect_faults: bool = False,
    ) -> BothEcus:
        """As `ecu.core.Core`; NotInCError for what C does not have."""
        c = C.ecu(calibration, form=form, limits=limits, detect_faults=detect_faults)
        return BothEcus(PYTHON.ecu(calibration, form=form, limits=limits, detect_faults=detect_faults), c)


BOTH: Final = BothCores()
