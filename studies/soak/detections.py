"""Detections of a real-time run, read from its files: the ECU's log, and the bus logs of both sides of the gateway.

The ECU logs its findings with their time stamps. The machine does not log its timeouts; its detections are reconstructed from the frames
that it received, by the same checks.
"""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dbc import loader_database
from dbc.columns import ColumnDecoder
from dbc.database import MessageCodec
from dbc.protection import Checker
from dbc.protection import Finding as Check
from dbc.recordings.logfile import FrameTable, read_candump
from ecu.calibration import load_calibration
from ecu.inputs import sources
from ecu.watched import MESSAGES, PLACE
from hil import rundir
from hil.ecu_side import CALIBRATION
from hil.faults.passage import Fault
from hil.timing.deadlines import TOLERANCE
from hil.timing.waits import Rows, explaining
from studies.soak.watch import OF_CHECK, Answer, Detection, Mechanism, Witness

# the ECU logs its findings as Python prints them: the repr of the dataclasses in ecu.findings
_FINDING = re.compile(
    r"(?P<kind>ProtectionFailed|Stale|Implausible|FaultFound)\((?P<fields>.*), at_ns=(?P<at_ns>\d+)\)"
)
_CHECK = re.compile(r"what=<Finding\.(\w+):")
_GROUP = re.compile(r"group='(\w+)'")
# What the plant checks of what it receives (plant.unit.reception).
HEARD_BY_MACHINE = ("Limits", "LinkageLimits", "EcuStatus")


def of_ecu(path: Path) -> list[Detection]:
    """The findings that the ECU logged in the run directory `path`."""
    lines = (path / rundir.ECU_LOG).read_text(encoding="utf-8").splitlines()
    return [detection for line in lines if (detection := _of_line(line)) is not None]


def _of_line(line: str) -> Detection | None:
    found = _FINDING.search(line)
    if found is None:
        return None
    mechanism = {
        "Stale": Mechanism.TIMEOUT,
        "Implausible": Mechanism.PLAUSIBILITY,
        "FaultFound": Mechanism.DETECTION,
    }.get(found["kind"])
    if mechanism is None and (check := _CHECK.search(found["fields"])) is not None:
        mechanism = OF_CHECK.get(Check[check[1]])
    if mechanism is None:
        return None
    fields = found["fields"]
    if mechanism is Mechanism.DETECTION:  # the detection names inputs of the estimators, not messages
        named = [MESSAGES[PLACE[word]] for word in re.findall(r"\w+", fields) if word in PLACE]
        fields = f"{', '.join(named)}: {fields}"
    return Detection(int(found["at_ns"]), Witness.ECU, mechanism, fields)


def of_machine(frames: FrameTable, stale_ns: int) -> list[Detection]:
    """Detections that the machine must have made in the frames of its bus; stale_ns: its timeout."""
    database = loader_database()
    detections = []
    for name in HEARD_BY_MACHINE:
        detections += list(_checked(frames, database.by_name[name]))
    at_ns = frames.time_ns[frames.can_id == database.by_name["Limits"].can_id]
    # a timeout is noticed when it has run out, not when the next frame ends the gap
    late = np.flatnonzero(np.diff(at_ns) > stale_ns)
    detections += [
        Detection(int(at_ns[i]) + stale_ns, Witness.MACHINE, Mechanism.TIMEOUT, "Limits stale") for i in late
    ]
    return sorted(detections, key=lambda detection: detection.at_ns)


def _checked(frames: FrameTable, codec: MessageCodec) -> Iterator[Detection]:
    # the machine's own class: counter and CRC rules cannot differ from those of the run
    checker = Checker(codec)
    for row in np.flatnonzero(frames.can_id == codec.can_id):
        at_ns = int(frames.time_ns[row])
        check = checker.check(frames.data[row, : frames.length[row]].tobytes(), at_ns)
        if check in OF_CHECK:
            yield Detection(at_ns, Witness.MACHINE, OF_CHECK[check], f"{codec.name}: {check.value}")


def of_bench(frames: FrameTable) -> list[Detection]:
    """Identifiers that no DBC knows."""
    known = np.array(sorted(loader_database().by_id), np.uint32)
    # with flags: an extended identifier of the same number is another message
    rows = np.flatnonzero(~np.isin(frames.can_id, known))
    return [
        Detection(int(frames.time_ns[row]), Witness.BENCH, Mechanism.UNKNOWN, "not in the DBC")
        for row in rows
    ]


def untimely(frames: FrameTable) -> list[Detection]:
    """Deadline violations of the cyclic messages of a bus: gaps that are too long or too short."""
    detections = []
    for codec in loader_database().by_name.values():
        if not codec.cycle_ns:
            continue  # sent on demand: no gap is too long
        at_ns = frames.time_ns[frames.can_id == codec.can_id]
        gaps = np.diff(at_ns)
        # late: known when the tolerance has run out; early: known when the frame is there
        late = at_ns[:-1][gaps > codec.cycle_ns * (1 + TOLERANCE)] + round(codec.cycle_ns * (1 + TOLERANCE))
        early = at_ns[1:][gaps < codec.cycle_ns * (1 - TOLERANCE)]
        for what, stamps in (("late", late), ("early", early)):
            detections += [
                Detection(stamp, Witness.BENCH, Mechanism.DEADLINE, f"{codec.name} {what}")
                for stamp in stamps.tolist()
            ]
    return sorted(detections, key=lambda detection: detection.at_ns)


def answers_of(frames: FrameTable) -> list[Answer]:
    """The answers of the ECU on its own bus: each state with the limits sent nearest to it in time."""
    columns = ColumnDecoder(loader_database()).decode(frames)
    if "EcuStatus" not in columns or "Limits" not in columns:
        return []
    status, limits = columns["EcuStatus"], columns["Limits"]
    nearest = _nearest(limits.time_s, status.time_s)
    return [
        Answer(
            round(at_s * 1e9),
            int(state),
            {name: float(values[row]) for name, values in limits.signals.items()},
        )
        for at_s, state, row in zip(status.time_s, status.signals["State"], nearest, strict=True)
    ]


def _nearest(times: NDArray[np.float64], wanted: NDArray[np.float64]) -> NDArray[np.intp]:
    """For each wanted time the row of `times` nearest to it."""
    after = np.clip(np.searchsorted(times, wanted), 1, max(len(times) - 1, 1))
    # with one time alone row 1 does not exist: clip and minimum keep both neighbours inside
    closer = wanted - times[after - 1] < times[np.minimum(after, len(times) - 1)] - wanted
    return np.where(closer, after - 1, np.minimum(after, len(times) - 1))


def messages_of(detection: Detection) -> frozenset[str]:
    """The messages that a detection is about: the one it names, or those of the input group it names."""
    if (group := _GROUP.search(detection.what)) is not None:
        rules = load_calibration(CALIBRATION).inputs
        return frozenset(s.message for s in sources(rules) if s.group.name.lower() == group[1])
    return frozenset(re.findall(r"\w+", detection.what)) & loader_database().by_name.keys()


def by_a_wait(detection: Detection, waits: Mapping[str, Mapping[str, Rows]], stale_ns: int) -> bool:
    """Whether a single wait for a processor explains a missed message: it delayed the sender by more than the message may be late.

    waits: by node, see `hil.judgement.waits_of_senders`. stale_ns: timeout of the machine; the ECU has its own rule.
    """
    # no wait of a processor changes the content of a frame
    if detection.mechanism is not Mechanism.TIMEOUT:
        return False
    ecu = detection.who is Witness.ECU
    sender = "Machine" if ecu else "EstimatorEcu"
    cycles = load_calibration(CALIBRATION).inputs.stale_cycles
    for name in messages_of(detection):
        cycle_ns = loader_database().by_name[name].cycle_ns
        limit_ns = round(cycles * cycle_ns) if ecu else stale_ns
        if explaining(
            waits.get(sender, {}), detection.at_ns - limit_ns, detection.at_ns, limit_ns - cycle_ns
        ):
            return True
    return False


def concerns(detection: Detection, fault: Fault) -> bool:
    """Whether a detection is about a message that the fault struck; a fault without a message strikes all."""
    struck = {codec.name for codec in fault.selection.codecs}
    return not struck or not struck.isdisjoint(messages_of(detection))


def read_bus(path: Path, name: str) -> FrameTable:
    """One of the logs of a run directory."""
    return read_candump(path / name)
