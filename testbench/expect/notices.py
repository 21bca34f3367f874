"""Who noticed an injected fault, and when: the ECU by what it says on the bus, the machine and the bench by what they must have seen.

The machine does not say what it finds. What it found follows from the frames that it was sent, by the same checks that it makes.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from dbc import loader_database
from dbc.watch import Trouble, Watch
from hil.faults.record import Injected
from hil.faults.table import matching
from hil.verdict import SLACK_S, Verdict
from testbench.expect.condition import Condition
from testbench.expect.evidence import Evidence
from testbench.expect.expectations import Window, begins, failed, open_question, passed

Witness = Literal["ecu", "machine", "bench"]
WITNESSES: Final[tuple[Witness, ...]] = ("ecu", "machine", "bench")
SAID_BY_ECU: Final = (
    "Warnings.InputStale > 0",
    "Warnings.InputImplausible > 0",
    "Warnings.ProtectionError > 0",
    "Warnings.EstimateInvalid > 0",
    "EcuStatus.StaleInputs > 0",
    "EcuStatus.State >= degraded",
)
"""How an ECU says on the bus that something is wrong with what it hears."""
HEARD_BY_MACHINE: Final = ("Limits", "LinkageLimits", "EcuStatus")


@dataclass(frozen=True, slots=True)
class Notice:
    """Something was noticed: when [s], and what in words."""

    at_s: float
    what: str


@dataclass(frozen=True, slots=True)
class Noticed:
    """An injected fault is noticed by somebody within a time.

    fault: its number in the order of the run's faults, the words its description begins with, or "" for every fault.
    by: a witness, or a condition that has to begin to hold.
    """

    fault: int | str
    by: Witness | Condition
    within_s: float

    @property
    def question(self) -> str:
        which = f"fault {self.fault}" if isinstance(self.fault, int) else self.fault or "every fault"
        return f"{which} noticed by {f'the {self.by}' if isinstance(self.by, str) else self.by} within {1e3 * self.within_s:g} ms"

    def judge(self, evidence: Evidence) -> Verdict:
        meant = [fault for fault in evidence.faults if self._means(fault)]
        struck = [fault for fault in meant if fault.struck]
        if not struck:
            why = "it struck no frame" if meant else "no such fault began"
            return open_question(self.question, why)
        told = []
        for fault in struck:
            first = self._first(evidence, fault)
            if first is None or first.at_s - fault.began_s > self.within_s + SLACK_S:
                when = (
                    "never"
                    if first is None
                    else f"only after {1e3 * (first.at_s - fault.began_s):.0f} ms ({first.what})"
                )
                return failed(self.question, f"{fault.fault} at {fault.began_s:.2f} s: {when}")
            told.append(f"after {1e3 * (first.at_s - fault.began_s):.0f} ms: {first.what}")
        return passed(self.question, "; ".join(told))

    def _means(self, fault: Injected) -> bool:
        if isinstance(self.fault, int):
            return fault.number == self.fault
        return fault.fault.startswith(self.fault)

    def _first(self, evidence: Evidence, fault: Injected) -> Notice | None:
        """The first notice that began after the fault did."""
        notices = (
            by_condition(evidence, self.by)
            if isinstance(self.by, Condition)
            else _BY[self.by](evidence, fault)
        )
        later = (notice for notice in notices if notice.at_s >= fault.began_s - SLACK_S)
        return min(later, key=lambda notice: notice.at_s, default=None)


def by_condition(evidence: Evidence, condition: Condition) -> Iterator[Notice]:
    """Each time a condition begins to hold."""
    series = condition.series(evidence)
    if series is not None:
        for at_s in begins(series, condition.holds(series.values)).tolist():
            yield Notice(at_s, str(condition))


def by_ecu(evidence: Evidence, _: Injected) -> Iterator[Notice]:
    """What the ECU said on the bus."""
    for text in SAID_BY_ECU:
        yield from by_condition(evidence, Condition.parse(text, loader_database()))


def by_machine(evidence: Evidence, _: Injected) -> Iterator[Notice]:
    """What the machine must have found in the frames that it obeys."""
    for name in HEARD_BY_MACHINE:
        yield from _watched(evidence, name, without=(Trouble.LATE,))
    limits = evidence.messages.get("Limits")
    if limits is not None:
        times = np.append(limits.time_s, evidence.duration_s)
        late = np.flatnonzero(np.diff(times) > evidence.limits_stale_s)
        for row in late.tolist():
            yield Notice(float(times[row]) + evidence.limits_stale_s, "Limits stale, own safe values")


def by_bench(evidence: Evidence, fault: Injected) -> Iterator[Notice]:
    """What whoever listens to the bus finds in the messages that the fault is about; all of them if it names none."""
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


def _watched(evidence: Evidence, name: str, without: tuple[Trouble, ...] = ()) -> Iterator[Notice]:
    """The troubles of one message, as its receiver finds them."""
    columns, table = evidence.messages.get(name), evidence.frames
    if columns is None or table is None:
        return
    watch = Watch(columns.codec)
    stamps: NDArray[np.int64] = np.rint(columns.time_s * 1e9).astype(np.int64)
    for row, at_ns in zip(columns.rows.tolist(), stamps.tolist(), strict=True):
        trouble = watch.receive(table.data[row, : table.length[row]].tobytes(), at_ns)
        if trouble is not None and trouble not in without:
            yield Notice(at_ns * 1e-9, f"{name}: {trouble.value}")
    end_ns = round(evidence.duration_s * 1e9)
    if (silent := watch.overdue(end_ns)) is not None:
        last_s = float(columns.time_s[-1])
        yield Notice(last_s + 3 * columns.codec.cycle_ns * 1e-9, f"{name}: {silent.value}")


__all__ = ["WITNESSES", "Notice", "Noticed", "Window", "Witness", "by_bench", "by_ecu", "by_machine"]
