"""Judges one run from its folder, for `run` and the campaigns: roll-over, timing, expectations of its scenario, remarks."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bus.address import inside_computer
from dbc import loader_database
from hil import rundir
from hil.compose import Choice
from hil.ending import Ending
from hil.foreign.duplicates import judge_senders
from hil.foreign.silence import judge_presence
from hil.judgement import NODES, PROCESSES, judge_run, timing_of
from hil.results import Case, Suite
from hil.rundir import RunDirectory, RunError
from hil.runs import RunResult
from hil.verdict import Result, RunVerdict, Verdict, judge_warning
from testbench.expect.evidence import Evidence
from testbench.expect.expectations import Expectation, judge_all
from testbench.expect.table import expectations_of

NODE_OF = {process: node for node, process in NODES.items()}
"""Side of the bench -> node of the DBC."""
# Above the share of the first ticks, in which every ECU is still in INIT.
REMARKABLE_SHARE = 0.01
"""Share of a run that the ECU spent outside *running* from which on the summary mentions it."""
FULL = 0.98
"""Share of the processors' time, in the busiest second, from which on none of them counts as ever idle."""
_REMARKABLE = ("init", "degraded", "fault", "not_available")


@dataclass(frozen=True, slots=True, kw_only=True)
class Conclusion:
    """One run with its verdicts."""

    name: str
    folder: Path
    ending: Ending  # how the run itself ended, whatever the verdicts say
    reason: str = ""  # why it ended so; empty for a complete run
    seen: RunVerdict | None = None  # roll-over; None without the plant's truth
    verdicts: tuple[Verdict, ...] = ()  # the bench's own: warning, foreign nodes, senders, timing
    expectations: tuple[Verdict, ...] = ()  # on the [[expect]] tables
    remarks: tuple[str, ...] = ()  # facts that are no verdict
    duration_s: float = 0.0  # simulated time [s]

    @property
    def everything(self) -> tuple[Verdict, ...]:
        """All verdicts."""
        return self.verdicts + self.expectations


def conclude(name: str, choice: Choice, folder: Path, result: RunResult) -> Conclusion:
    """Judge the run in `folder`, and note the verdicts on the expectations in its run.json."""
    # a run that did not end by itself has incomplete files: expectations would be judged on a part of it
    if result.ending is not Ending.PASSED:
        return Conclusion(name=name, folder=folder, ending=result.ending, reason=result.reason)
    run = RunDirectory.read(folder)
    seen = roll_over_of(run)
    judged = judge_expectations(run, choice)
    if judged:
        # kept beside the run, so that a report made later shows the verdicts of the criteria that were used
        rundir.write_record(folder, replace(run.record, expectations=judged))
    return Conclusion(
        name=name,
        folder=folder,
        ending=result.ending,
        seen=seen,
        verdicts=tuple(_verdicts(run, seen)),
        expectations=judged,
        remarks=tuple(remarks(run, seen)),
        duration_s=run.record.duration_s,
    )


def _verdicts(run: RunDirectory, seen: RunVerdict | None) -> Iterator[Verdict]:
    """The bench's own verdicts on a run."""
    if seen is not None and seen.lifted:
        # only where a wheel lifted: without lift-off there is nothing that a warning could precede
        yield judge_warning(seen)
    for side, bus in run.record.foreign.items():
        node = NODE_OF[side]
        times = [columns.time_s for columns in run.messages.values() if node in columns.codec.senders]
        # a node beyond a CAN interface does not wait for this computer
        host_s = _kept_waiting(run) if inside_computer(bus) else 0.0
        yield judge_presence(
            node, np.concatenate(times) if times else [], end_s=run.record.duration_s, host_s=host_s
        )
    yield from judge_senders(run.record.statistics, PROCESSES)
    yield from timing_verdicts(run)


def _kept_waiting(run: RunDirectory) -> float:
    """How long the host may have kept a process of this computer from its processor within one second [s]."""
    # the waits of a process that is not ours are not known: where no processor was ever idle, it may have waited all the time
    if run.record.vitals is not None and run.record.vitals.most_busy >= FULL:
        return 1.0
    timing = timing_of(run)
    shares = (timing.worst_stolen, *timing.worst_waited.values())
    return max(share for share in shares if math.isfinite(share))


def roll_over_of(run: RunDirectory) -> RunVerdict | None:
    """The verdict on roll-over; None for a run without truth."""
    try:
        return judge_run(run)
    # a foreign plant leaves no truth: nothing can be said of roll-over, which is no failure of the ECU
    except RunError:
        return None


def expectations_for(choice: Choice) -> tuple[Expectation, ...]:
    """The [[expect]] tables of the scenario, then those of the file beside it."""
    database = loader_database()
    return tuple(
        expectation
        for file in choice.expectation_files()
        for expectation in expectations_of(file, database, alone=file == choice.expect)
    )


def judge_expectations(run: RunDirectory, choice: Choice) -> tuple[Verdict, ...]:
    """The verdicts on all expectations of a choice."""
    # the age at which this machine takes its own safe values is a property of its equipment file
    stale_s = choice.load().equipment.obedience.stale_after
    return judge_all(expectations_for(choice), Evidence.of(run, stale_s))


def timing_verdicts(run: RunDirectory) -> list[Verdict]:
    """The verdicts on timing of a real-time run: messages and ticks. Empty in lockstep."""
    kept = run.record.punctuality
    return [] if kept is None else [kept.frames, kept.ticks]


def remarks(run: RunDirectory, seen: RunVerdict | None) -> Iterable[str]:
    """What a reader must not overlook: the machine rolled over, the ECU did not run."""
    if seen is not None and seen.rolled_over_s is not None:
        yield f"the machine rolled over at {seen.rolled_over_s:.2f} s"
    status = run.messages.get("EcuStatus")
    # frames before time zero are those of an ECU that waits for its machine
    if status is None or not (during := status.time_s >= 0).any():
        yield "no EcuStatus on the bus: the state of the ECU is not known"
        return
    states, times = status.signals["State"][during], status.time_s[during]
    names = status.codec.by_signal["State"].choices
    for value in np.unique(states).tolist():
        share = float(np.mean(states == value))
        if names.get(value) in _REMARKABLE and share >= REMARKABLE_SHARE:
            first_s = float(times[np.argmax(states == value)])
            yield f"the ECU was in state {names[value]} for {100 * share:.0f} % of the run, first at {first_s:.2f} s"


def ending_of(conclusions: Sequence[Conclusion], *, strict: bool) -> Ending:
    """INTERRUPTED if one was, else how the first that did not end well ended, else what the verdicts say."""
    # a run that was cut short says nothing of the controller, so its ending comes before all verdicts
    endings = [each.ending for each in conclusions if each.ending is not Ending.PASSED]
    if endings:
        return Ending.INTERRUPTED if Ending.INTERRUPTED in endings else endings[0]
    verdicts = [verdict for each in conclusions for verdict in each.verdicts]
    expectations = [verdict for each in conclusions for verdict in each.expectations]
    return exit_code(verdicts, expectations, strict=strict)


def exit_code(verdicts: Iterable[Verdict], expectations: Iterable[Verdict] = (), *, strict: bool) -> Ending:
    """FAILED if any verdict failed; INCONCLUSIVE if an expectation could not be judged.

    strict: a verdict of the bench that could not be reached fails too.
    """
    expected = {verdict.result for verdict in expectations}
    bad = {Result.FAILED, Result.INCONCLUSIVE} if strict else {Result.FAILED}
    # expectations are the user's criteria: one that cannot be judged never passes. The bench's own verdicts may be
    # inconclusive on a busy host without making the run fail, unless the user asked for it.
    if Result.FAILED in expected or any(verdict.result in bad for verdict in verdicts):
        return Ending.FAILED
    return Ending.INCONCLUSIVE if Result.INCONCLUSIVE in expected else Ending.PASSED


def suite_of(conclusion: Conclusion, *, strict: bool = False) -> Suite:
    """A run as a suite; one that did not end well has that as its first case."""
    # JUnit readers count cases: without this one a killed run would be a suite without a failure
    ended = Case(
        name="the run ends by itself",
        result=Result.PASSED if conclusion.ending is Ending.PASSED else Result.FAILED,
        reason=conclusion.reason or f"{conclusion.duration_s:.2f} s recorded",
    )
    # the bench's own verdicts decide in a JUnit file exactly where they decide the exit code
    judged = [Case.of(verdict, decides=strict) for verdict in conclusion.verdicts]
    expected = [Case.of(verdict) for verdict in conclusion.expectations]
    return Suite(
        name=conclusion.name,
        cases=(ended, *judged, *expected),
        time_s=conclusion.duration_s,
        remarks=conclusion.remarks,
    )
