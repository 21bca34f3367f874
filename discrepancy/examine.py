"""From a model and recordings to a verdict, whatever the recordings are worth."""

from collections.abc import Sequence
from dataclasses import replace

from discrepancy.findings import Findings
from discrepancy.judge import Judgement, judge, nothing_usable
from discrepancy.model import Model
from discrepancy.plausible import implausible
from discrepancy.problem import Problem, Unusable
from discrepancy.recording import Complaint, Recording
from discrepancy.rehearsal import rehearse
from discrepancy.state import Progress, Settings
from discrepancy.windows import OUTPUTS


def examine(
    model: Model, recordings: Sequence[Recording], settings: Settings, progress: Progress = lambda _: None
) -> Findings:
    """The verdict on recordings, usable or not."""
    judged = investigate(model, recordings, settings, progress)
    return judged.findings if isinstance(judged, Judgement) else judged


def investigate(
    model: Model,
    recordings: Sequence[Recording],
    settings: Settings,
    progress: Progress = lambda _: None,
    complaints: Sequence[Complaint] = (),
) -> Judgement | Findings:
    """The verdict with what it rests on, or the verdict alone where nothing is usable; complaints: of those who read.

    A channel whose scale or clock cannot be right is left out and told; the others are judged.
    """
    try:
        problem, doubted = usable(model, recordings)
    except Unusable as error:
        names = list(dict.fromkeys([*(r.name for r in recordings), *(c.recording for c in complaints)]))
        return nothing_usable(model.name, names, preceded(error, complaints))
    problem.complaints[:0] = [*complaints, *doubted]
    return judge(problem, settings, progress)


def usable(model: Model, recordings: Sequence[Recording]) -> tuple[Problem, list[Complaint]]:
    """The problem without implausible channels, and what was said of those. Raises Unusable if nothing is left, BadModel."""
    problem = Problem(model, recordings)
    rehearse(problem)
    doubted = implausible(problem)
    if not doubted:
        return problem, []
    gone = {(c.recording, c.signal) for c in doubted}
    kept = [
        replace(r, signals={name: s for name, s in r.signals.items() if (r.name, name) not in gone})
        for r in recordings
    ]
    try:
        return Problem(model, kept), doubted
    except Unusable as error:
        left = [
            c for c in error.complaints if c.signal != OUTPUTS
        ]  # that none is there follows from what is doubted
        raise Unusable([*doubted, *left]) from error


def preceded(error: Unusable, first: Sequence[Complaint]) -> Unusable:
    """The same with more to complain of, most important first."""
    return Unusable([*first, *error.complaints])
