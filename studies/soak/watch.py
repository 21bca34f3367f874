"""A lockstep run with faults, and what each witness (ECU, machine, bench) detects by which mechanism.

There are three witnesses: the ECU checks its inputs, the machine checks the limits that it receives, and the bench compares the times of
all messages on the bus with the DBC.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from bus.frame import Frame
from dbc import loader_database
from dbc.protection import Finding as Check
from ecu.findings import FaultFound, Implausible, ProtectionFailed, Stale
from ecu.watched import MESSAGES, PLACE
from hil.compose import calibration_of, plant_unit
from hil.ecu_side import ecu_cycle
from hil.faults.injector import Injector
from hil.faults.passage import Fault
from hil.faults.restartable import RestartableEcu, RestartablePlant, acting_on
from hil.faults.wire import FaultyWire
from hil.lockstep import EcuTick, Lockstep
from hil.timing.deadlines import Observation, Observer, judge_message
from hil.verdict import Result
from plant.unit.reception import Finding as MachineFinding
from plant.unit.scenario import Scenario


class Mechanism(StrEnum):
    """The check that detects a fault."""

    CRC = "CRC"
    COUNTER = "counter"
    TIMEOUT = "timeout"
    PLAUSIBILITY = "plausibility"
    DETECTION = "detection"
    DEADLINE = "deadline"
    UNKNOWN = "unknown identifier"


class Witness(StrEnum):
    """Who detects a fault."""

    ECU = "ECU"
    MACHINE = "machine"
    BENCH = "bench"


OF_CHECK = {
    Check.WRONG_CRC: Mechanism.CRC,
    Check.MASQUERADED: Mechanism.CRC,
    Check.LOST: Mechanism.COUNTER,
    Check.RESTARTED: Mechanism.COUNTER,
    Check.REPEATED: Mechanism.COUNTER,
    Check.REORDERED: Mechanism.COUNTER,
    Check.WRONG_COUNTER: Mechanism.COUNTER,
}


@dataclass(frozen=True, slots=True)
class Detection:
    """One detection."""

    at_ns: int  # simulated time, or in a real-time run the time stamp of the log
    who: Witness
    mechanism: Mechanism
    what: str  # message and finding, for the reader


@dataclass(frozen=True, slots=True)
class Answer:
    """The ECU's answer in one tick."""

    at_ns: int
    state: int  # as in the DBC
    limits: dict[str, int | float]  # by signal, in the DBC's units


class Watch:
    """Runs a scenario tick by tick and collects `detections` and `answers` until `forget`."""

    def __init__(self, scenario: Scenario, faults: Sequence[Fault], *, seed: int) -> None:
        database = loader_database()
        self._known = frozenset(database.by_id)
        self._cyclic = {codec.can_id: codec for codec in database.by_name.values() if codec.cycle_ns}
        self._stale_ns = round(scenario.equipment.obedience.stale_after * 1e9)
        self._unit = plant_unit(scenario)
        calibration = calibration_of(scenario)
        # between ECU and wire: a fault on the bus must not change what the ECU is judged by
        self._probe = _Probe(
            RestartableEcu(
                lambda: ecu_cycle(form="corrected", limits=True, calibration=calibration, detect_faults=True)
            )
        )
        self.injector = Injector(database, faults, seed=seed)
        self.injector.start(0)
        plant = RestartablePlant(self._unit)
        wire = FaultyWire(self.injector, acting_on(plant, self._probe.inner))
        self._bench = Lockstep(plant, self._probe, wire=wire, reference=False)
        self._limits_stale = False
        self._stamps: defaultdict[int, list[int]] = defaultdict(list)
        self._since_ns = 0
        self.detections: list[Detection] = []

    @property
    def now_ns(self) -> int:
        """Time of the next tick."""
        return self._bench.now_ns

    @property
    def finished(self) -> bool:
        """Whether the scenario is over."""
        return self._unit.finished

    @property
    def rolled_over(self) -> bool:
        """Whether the machine lies on its side."""
        return self._unit.rolled_over

    @property
    def sane(self) -> bool:
        """Whether the machine's motion is finite."""
        return bool(np.isfinite(self._unit.truth.row).all())

    @property
    def answers(self) -> list[Answer]:
        """Answers of the ECU since `forget`."""
        return self._probe.answers

    def step(self) -> None:
        """Simulate one tick and collect its detections."""
        self._bench.step()
        # taken tick by tick: hours of frames would fill the memory
        recording = self._bench.take()
        self.detections += [n for f in recording.ecu_findings if (n := of_ecu(f)) is not None]
        self.detections += [n for f in recording.plant_findings if (n := of_machine(f)) is not None]
        self._watch_limits()
        for frame in recording.bus:
            # once per identifier: a flood is one detection
            if frame.can_id not in self._known and frame.can_id not in self._stamps:
                what = f"0x{frame.identifier:X} is not in the DBC"
                self.detections.append(Detection(frame.at_ns, Witness.BENCH, Mechanism.UNKNOWN, what))
            self._stamps[frame.can_id].append(frame.at_ns)

    def forget(self) -> None:
        """Clear all detections and answers; deadlines are judged from here on."""
        self.detections.clear()
        self.answers.clear()
        self._stamps.clear()
        self._since_ns = self.now_ns

    def detected(self, since_ns: int) -> dict[tuple[Witness, Mechanism], float]:
        """By witness and mechanism, the first detection since `forget`: milliseconds after `since_ns`.

        The bench judges deadlines only at the end, so theirs have no time and get 0.
        """
        first: dict[tuple[Witness, Mechanism], float] = {}
        for detection in self.detections:
            # detections are in the order of time: the first stays
            first.setdefault((detection.who, detection.mechanism), (detection.at_ns - since_ns) * 1e-6)
        if self.late_messages():
            first[Witness.BENCH, Mechanism.DEADLINE] = 0.0
        return first

    def late_messages(self) -> list[str]:
        """Messages that missed their deadlines since `forget`, one line each."""
        observer = Observer(start_ns=self._since_ns, end_ns=self.now_ns)
        verdicts = [
            judge_message(
                Observation(
                    name=codec.name,
                    period_ns=codec.cycle_ns,
                    at_ns=np.array(self._stamps.get(can_id, ()), np.int64),
                ),
                observer,
            )
            # also messages without a stamp: one that stays away has no other sign
            for can_id, codec in self._cyclic.items()
        ]
        return [f"{v.name}: {v.reason}" for v in verdicts if v.result is Result.FAILED]

    def _watch_limits(self) -> None:
        """Detect the machine's own timeout of the limits: it reacts to it without reporting it."""
        # at the change only, as a machine with a log would report it
        stale = self.now_ns - self._unit.reception.limits_ns > self._stale_ns
        if stale and not self._limits_stale:
            self.detections.append(
                Detection(self.now_ns, Witness.MACHINE, Mechanism.TIMEOUT, "Limits stale, own safe values")
            )
        self._limits_stale = stale


class _Probe:
    """An ECU whose frames are read before they reach the bus, where faults may change them."""

    def __init__(self, inner: RestartableEcu) -> None:
        database = loader_database()
        self.inner = inner
        self.answers: list[Answer] = []
        self._status, self._limits = database.by_name["EcuStatus"], database.by_name["Limits"]

    def receive(self, frame: Frame, now_ns: int) -> Sequence[object]:
        return self.inner.receive(frame, now_ns)

    def tick(self, now_ns: int) -> EcuTick:
        tick = self.inner.tick(now_ns)
        sent = {frame.can_id: frame.data for frame in tick.frames}
        # a state and its limits belong to one answer; a tick in which the ECU sends only one of them is no answer
        if self._status.can_id in sent and self._limits.can_id in sent:
            state = self._status.decode_dict(sent[self._status.can_id])["State"]
            limits = self._limits.decode_dict(sent[self._limits.can_id])
            self.answers.append(Answer(now_ns, int(state), limits))
        return tick


def of_ecu(finding: object) -> Detection | None:
    """A finding of the ECU as a detection; None for its changes of state, which follow from others."""
    match finding:
        case ProtectionFailed(message, what, at_ns) if what in OF_CHECK:
            return Detection(at_ns, Witness.ECU, OF_CHECK[what], f"{message}: {what.value}")
        case Stale(group, at_ns):
            return Detection(at_ns, Witness.ECU, Mechanism.TIMEOUT, f"{group} stale")
        case Implausible(message, signal, _, reason, at_ns):
            return Detection(at_ns, Witness.ECU, Mechanism.PLAUSIBILITY, f"{message}.{signal}: {reason}")
        case FaultFound(signals, mode, at_ns):
            return Detection(
                at_ns, Witness.ECU, Mechanism.DETECTION, f"{_messages(signals)}: {mode.name.lower()}"
            )
    return None


def _messages(signals: Sequence[str]) -> str:
    """The signals with the messages that carry them."""
    return ", ".join(f"{MESSAGES[PLACE[signal]]} {signal}" for signal in signals)


def of_machine(finding: object) -> Detection | None:
    """A finding of the machine as a detection."""
    match finding:
        case MachineFinding(message, what, at_ns) if what in OF_CHECK:
            return Detection(at_ns, Witness.MACHINE, OF_CHECK[what], f"{message}: {what.value}")
    return None
