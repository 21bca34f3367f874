"""From what the cycle finds to trouble codes: which suspect parameter failed in which way, and until when."""

from collections.abc import Iterable, Mapping
from typing import Final

from dbc.database import Database
from ecu.bus_signals import Received, rows
from ecu.codes import ESTIMATORS, FreezeFrame, Mode, TroubleCodes
from ecu.estimators.signals import Inputs
from ecu.findings import EstimatorFailed, FaultFound, Finding, Implausible, ProtectionFailed
from ecu.inputs import EXCHANGED, FROZEN, MOVED, OUTSIDE, CycleInputs, Echoed
from ecu.rules import InputRules
from ecu.watched import Beside

_OF_REASON: Final[Mapping[str, Mode]] = {
    FROZEN: Mode.NOT_RESPONDING,
    EXCHANGED: Mode.EXCHANGED,
    MOVED: Mode.RATE_OF_CHANGE,
    OUTSIDE: Mode.ABOVE_RANGE,
}
_ROWS: Final = {
    (row.message, row.signal): (name, row)
    for kind in (Inputs, Echoed, Beside)
    for name, row in rows(kind, Received)
}


def mode_of(finding: Implausible) -> Mode:
    """The failure mode that a reason stands for; a sensor that reports or sends nothing is a bad device."""
    for start, mode in _OF_REASON.items():
        if finding.reason.startswith(start):
            below = mode is Mode.ABOVE_RANGE and finding.value < 0.0
            return Mode.BELOW_RANGE if below else mode
    return Mode.BAD_DEVICE


class Troubles:
    """Keeps the trouble codes of one ECU."""

    def __init__(self, rules: InputRules, database: Database) -> None:
        self.codes = TroubleCodes(database)
        self.full = {name: getattr(rules, row.limit) if row.limit else 1.0 for name, row in _ROWS.values()}
        self._started_ns: int | None = None

    def step(self, findings: Iterable[Finding], received: CycleInputs, speed: float, now_ns: int) -> None:
        """One cycle: its findings become codes; codes whose inputs are still unusable go on.

        speed: of the machine as estimated [m/s]. Messages that have not been heard since start are no fault yet.
        """
        if self._started_ns is None:
            self._started_ns = now_ns
        self.codes.continued(received.unusable | received.silent | received.doubted, now_ns)
        # sorted: a set has no order of its own, and codes keep that in which they came
        for name in sorted(received.silent):
            self._occurred(name, Mode.UPDATE_RATE, received, speed, now_ns)
        for finding in findings:
            match finding:
                case Implausible(message, signal, _, _, _):
                    self._occurred(_ROWS[message, signal][0], mode_of(finding), received, speed, now_ns)
                case ProtectionFailed(message, _, _):
                    name = f"message_{message}"
                    self._occurred(name, Mode.DATA_IN_ERROR, received, speed, now_ns)
                case FaultFound(signals, mode, _):
                    for name in signals:
                        self._occurred(name, mode, received, speed, now_ns)
                case EstimatorFailed():
                    self._occurred(ESTIMATORS, Mode.BAD_DEVICE, received, speed, now_ns)

    def _occurred(self, name: str, mode: Mode, received: CycleInputs, speed: float, now_ns: int) -> None:
        assert self._started_ns is not None
        v = received.values
        frozen = FreezeFrame(
            v.get(name, 0.0) / self.full.get(name, 1.0),
            speed,
            v["articulation_angle"],
            v["lift_arm_angle"],
            (now_ns - self._started_ns) * 1e-9,
        )
        self.codes.occurred(name, mode, now_ns, frozen)
