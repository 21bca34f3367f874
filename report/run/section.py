"""Prepares a run for the report: its name beside the others, its verdicts, its headline."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from hil.judgement import judge_run, timing_of
from hil.rundir import RunDirectory, RunError, RunRecord
from hil.timing.measured import Timing, judge_timing
from hil.verdict import WHEELS, RunVerdict, Verdict, judge_prevention, judge_warning
from report.render import Pictures, pictures_of

_TRAITS: tuple[Callable[[RunRecord], str], ...] = (
    lambda r: r.scenario.replace("_", " "),
    lambda r: r.machine,
    lambda r: f"{r.payload_kg:.0f} kg",
    lambda r: r.form,
    lambda r: "limits on" if r.limits else "limits off",
    lambda r: "sensors tested against each other" if r.detect_faults else "sensors not tested",
    lambda r: "real time" if r.mode == "realtime" else "lockstep",
    lambda r: f"{r.ecu_core} core",
    lambda r: f"seed {r.seed}",
    lambda r: ", ".join(r.changes) or "nothing changed",
)


@dataclass(frozen=True, slots=True)
class Section:
    """One run with everything that the page shows of it."""

    name: str  # by which it differs from the other runs of the page
    run: RunDirectory
    verdict: RunVerdict | None  # None: not judged
    doubt: str  # why it could not be judged
    timing: Timing | None  # of a real-time run
    pictures: Pictures

    @property
    def end_s(self) -> float:
        """End of its recording [s]; 0 if it is not known."""
        truth = self.run.truth
        ends = [float(c.time_s[-1]) for c in self.run.messages.values() if len(c.time_s)]
        known = float(truth["time_s"][-1]) if "time_s" in truth and truth["time_s"].size else 0.0
        return known or max(ends, default=0.0)

    @property
    def problems(self) -> list[str]:
        """What is missing, one sentence each."""
        found = list(self.run.problems)
        if self.doubt:
            found.append(f"no verdict: {self.doubt}")
        if self.pictures.missing:
            found.append(f"no pictures: {self.pictures.missing}")
        return found


def sections_of(runs: Sequence[RunDirectory]) -> list[Section]:
    """One section per run, named by the traits in which the runs differ."""
    return [_section(name, run) for name, run in zip(names([run.record for run in runs]), runs, strict=True)]


def _section(name: str, run: RunDirectory) -> Section:
    verdict, doubt = None, ""
    try:
        verdict = judge_run(run)
    # a run without a verdict still has signals, timing and faults to report
    except (RunError, ValueError) as error:
        doubt = str(error)
    timing = timing_of(run) if run.record.mode == "realtime" else None
    return Section(name, run, verdict, doubt, timing, pictures_of(run, verdict))


def names(records: Sequence[RunRecord]) -> list[str]:
    """A name per run, from the traits in which they differ; a single run is named by its limits."""
    if len(records) == 1:
        return [_TRAITS[4](records[0])]
    differing = [trait for trait in _TRAITS if len({trait(r) for r in records}) > 1]
    found = [", ".join(trait(r) for trait in differing) or "run" for r in records]
    seen: Counter[str] = Counter()
    result = []
    for name in found:
        seen[name] += 1
        result.append(name if found.count(name) == 1 else f"{name} ({seen[name]})")
    return result


def partner(section: Section, others: Sequence[Section]) -> Section | None:
    """The run of the same case with the opposite setting of the ECU's limits; None if there is none."""

    def case(s: Section) -> tuple[object, ...]:
        r = s.run.record
        return r.scenario, r.machine, r.payload_kg, r.form, r.changes

    return next(
        (
            other
            for other in others
            if case(other) == case(section) and other.run.record.limits != section.run.record.limits
        ),
        None,
    )


def verdicts(sections: Sequence[Section]) -> list[Verdict]:
    """Warning in time, prevention, deadlines, timing: for every run that can answer."""
    several = len(sections) > 1
    warned = [
        _named(judge_warning(s.verdict), s.name if several else "")
        for s in sections
        if s.verdict is not None and s.verdict.lifted
    ]
    prevented = [
        judge_prevention(free.verdict, s.verdict)
        for s in sections
        if s.run.record.limits and s.verdict and (free := partner(s, sections)) and free.verdict
    ]
    kept = [
        _named(verdict, s.name if several else "")
        for s in sections
        if s.timing
        for verdict in ([s.run.record.punctuality.frames] if s.run.record.punctuality else [])
        + [judge_timing(s.timing)]
    ]
    expected = [
        _named(verdict, s.name if several else "") for s in sections for verdict in s.run.record.expectations
    ]
    return warned + prevented + kept + expected


def _named(verdict: Verdict, name: str) -> Verdict:
    if not name:
        return verdict
    return Verdict(question=f"{name}: {verdict.question}", result=verdict.result, reason=verdict.reason)


@dataclass(frozen=True, slots=True)
class Headline:
    """The outcome of a run for the top of the page."""

    words: str  # a few words
    kind: str  # good, warned, lifted or unknown; chooses the colour
    story: str  # one or two sentences


def headline(section: Section, others: Sequence[Section]) -> Headline:
    """The outcome of a run in plain words."""
    verdict = section.verdict
    if verdict is None:
        return Headline("Not judged", "unknown", f"{section.doubt}.")
    if verdict.lift_off_s is not None and verdict.lifting_wheel is not None:
        wheel = WHEELS[verdict.lifting_wheel]
        lifted = f"The {wheel} wheel lifted at {verdict.lift_off_s:.2f} s; {_warned(verdict)}."
        if verdict.rolled_over_s is None:
            return Headline("A wheel lifted", "lifted", f"{lifted} The machine came down again or stayed up.")
        at = f"It passed 45° of roll at {verdict.rolled_over_s:.2f} s."
        return Headline(f"Rolled over at {verdict.rolled_over_s:.2f} s", "lifted", f"{lifted} {at}")
    kept = f"No wheel lifted: each kept at least {100 * verdict.margin:.0f} % of its standing load."
    came = (
        f"The ECU warned at {verdict.warned_s:.2f} s." if verdict.warned_s is not None else "No warning came."
    )
    free = partner(section, others)
    if section.run.record.limits and free and free.verdict and free.verdict.lifted:
        what = "Roll-over" if free.verdict.rolled_over else "Lift-off"
        return Headline(f"{what} prevented", "good", f"{kept} {came}")
    if verdict.false_alarm:
        return Headline("False alarm", "warned", f"{kept} {came}")
    return Headline("All wheels stayed down", "good", f"{kept} {came}")


def _warned(verdict: RunVerdict) -> str:
    lead = verdict.lead_s
    if lead is None or verdict.warned_s is None:
        return "the ECU never warned"
    return (
        f"the ECU had warned at {verdict.warned_s:.2f} s, {lead:.2f} s before"
        if lead > 0
        else (f"the ECU warned at {verdict.warned_s:.2f} s, {-lead:.2f} s too late")
    )
