"""Judges who detected an injected fault, and after what time, for the expectation `detected`.

The ECU reports what it detects on the bus. The machine does not: what it must have detected follows from the frames that it was
sent, by the same checks that it makes. The bench is any listener on the bus that checks every message.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from dbc import loader_database
from dbc.watch import SILENT, Trouble, Watch
from hil.faults.record import Injected
from hil.faults.table import matching
from hil.verdict import SLACK_S, Verdict
from testbench.expect.condition import Condition
from testbench.expect.evidence import Evidence
from testbench.expect.expectations import Window, begins, failed, open_question, passed

Witness = Literal["ecu", "machine", "bench"]
WITNESSES: Final[tuple[Witness, ...]] = ("ecu", "machine", "bench")
REPORTED_BY_ECU: Final = (
    "Warnings.InputStale > 0",
    "Warnings.InputImplausible > 0",
    "Warnings.ProtectionError > 0",
    "Warnings.EstimateInvalid > 0",
    "EcuStatus.StaleInputs > 0",
    "EcuStatus.State >= degraded",
)
"""The signals by which an ECU reports that something is wrong with the frames that it receives."""
# What the plant reads of the ECU (plant.unit.reception).
OBEYED_BY_MACHINE: Final = ("Limits", "LinkageLimits", "EcuStatus")


@dataclass(frozen=True, slots=True)
class Detection:
    """One sign that somebody detected a fault."""

    at_s: float  # on the clock of the run [s]
    what: str  # in plain text, for the report


@dataclass(frozen=True, slots=True)
class Detected:
    """An injected fault is detected by a witness within a time."""

    fault: (
        int | str
    )  # its number in the order of the run's faults, the begin of its description, or "" for every fault
    by: Witness | Condition  # who has to detect it, or a condition that has to become true
    within_s: float  # after the begin of the fault [s]

    @property
    def question(self) -> str:
        which = f"fault {self.fault}" if isinstance(self.fault, int) else self.fault or "every fault"
        return f"{which} detected by {f'the {self.by}' if isinstance(self.by, str) else self.by} within {1e3 * self.within_s:g} ms"

    def judge(self, evidence: Evidence) -> Verdict:
        meant = [fault for fault in evidence.faults if self._means(fault)]
        # a fault that changed no frame cannot be detected by anybody: that is no failure of the witness
        struck = [fault for fault in meant if fault.struck]
        if not struck:
            why = "it affected no frame" if meant else "no such fault began"
            return open_question(self.question, why)
        after = []
        for fault in struck:
            first = self._first(evidence, fault)
            if first is None or first.at_s - fault.began_s > self.within_s + SLACK_S:
                when = (
                    "never"
                    if first is None
                    else f"only after {1e3 * (first.at_s - fault.began_s):.0f} ms ({first.what})"
                )
                # one fault that nobody detected decides, whatever was seen of the others
                return failed(self.question, f"{fault.fault} at {fault.began_s:.2f} s: {when}")
            after.append(f"after {1e3 * (first.at_s - fault.began_s):.0f} ms: {first.what}")
        return passed(self.question, "; ".join(after))

    def _means(self, fault: Injected) -> bool:
        if isinstance(self.fault, int):
            return fault.number == self.fault
        return fault.fault.startswith(self.fault)

    def _first(self, evidence: Evidence, fault: Injected) -> Detection | None:
        """The first detection at or after the begin of the fault; None if there is none."""
        detections = (
            by_condition(evidence, self.by)
            if isinstance(self.by, Condition)
            else _BY[self.by](evidence, fault)
        )
        # signs of an earlier fault that still last do not count: only what begins with or after this one
        later = (each for each in detections if each.at_s >= fault.began_s - SLACK_S)
        return min(later, key=lambda each: each.at_s, default=None)


def by_condition(evidence: Evidence, condition: Condition) -> Iterator[Detection]:
    """Each time at which a condition becomes true."""
    series = condition.series(evidence)
    if series is not None:
        for at_s in begins(series, condition.holds(series.values)).tolist():
            yield Detection(at_s, str(condition))


def by_ecu(evidence: Evidence, _: Injected) -> Iterator[Detection]:
    """What the ECU reported on the bus."""
    for text in REPORTED_BY_ECU:
        yield from by_condition(evidence, Condition.parse(text, loader_database()))


def by_machine(evidence: Evidence, _: Injected) -> Iterator[Detection]:
    """What the machine must have detected in the frames that it obeys."""
    for name in OBEYED_BY_MACHINE:
        # the machine has no rule for one late frame: it reacts only when the limits are stale, below
        yield from _watched(evidence, name, without=(Trouble.LATE,))
    # the machine cares for the age of Limits, whatever their cycle time is
    limits = evidence.messages.get("Limits")
    if limits is not None:
        # limits that stay away until the end are stale without a frame that shows it
        times = np.append(limits.time_s, evidence.duration_s)
        late = np.flatnonzero(np.diff(times) > evidence.limits_stale_s)
        for row in late.tolist():
            yield Detection(float(times[row]) + evidence.limits_stale_s, "Limits stale, own safe values")


def by_bench(evidence: Evidence, fault: Injected) -> Iterator[Detection]:
    """What a listener on the bus detects in the messages that the fault names; in all messages if it names none."""
    # a description is "kind message key=value ...", see `hil.faults.table`; the message may be missing
    words = fault.fault.split()
    database = loader_database()
    named = (
        [codec.name for codec in matching(words[1], database)]
        if len(words) > 1 and "=" not in words[1]
        else []
    )
    for name in named or database.by_name:
        yield from _watched(evidence, name)


_BY: Final = {"ecu": by_ecu, "machine": by_machine, "bench": by_bench}


def _watched(evidence: Evidence, name: str, without: tuple[Trouble, ...] = ()) -> Iterator[Detection]:
    """The troubles of one message, as its receiver finds them."""
    columns, table = evidence.messages.get(name), evidence.frames
    if columns is None or table is None:
        return
    watch = Watch(columns.codec)
    # back to whole nanoseconds: float seconds hold them exactly enough for runs of days
    stamps: NDArray[np.int64] = np.rint(columns.time_s * 1e9).astype(np.int64)
    for row, at_ns in zip(columns.rows.tolist(), stamps.tolist(), strict=True):
        trouble = watch.receive(table.data[row, : table.length[row]].tobytes(), at_ns)
        if trouble is not None and trouble not in without:
            yield Detection(at_ns * 1e-9, f"{name}: {trouble.value}")
    end_ns = round(evidence.duration_s * 1e9)
    if (silent := watch.overdue(end_ns)) is not None:
        # the watch notes the silence at the end of the recording; a receiver notes it SILENT cycles after the last frame
        last_s = float(columns.time_s[-1])
        yield Detection(last_s + SILENT * columns.codec.cycle_ns * 1e-9, f"{name}: {silent.value}")


__all__ = ["WITNESSES", "Detected", "Detection", "Window", "Witness", "by_bench", "by_ecu", "by_machine"]
