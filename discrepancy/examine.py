"""The entrance of the engine: from a model and recordings to a verdict, also for unusable recordings."""

from collections.abc import Sequence
from dataclasses import replace

from discrepancy.checks.channel_checks import failing_channels
from discrepancy.checks.model_check import check_model
from discrepancy.checks.spikes import spikes
from discrepancy.checks.wrapped import wrapped
from discrepancy.decision.judge import judge, nothing_usable
from discrepancy.decision.judgement import Judgement
from discrepancy.estimation.problem import Problem, Unusable
from discrepancy.model.description import Model
from discrepancy.model.windows import OUTPUTS
from discrepancy.selection.bandwidth import at_bandwidth
from discrepancy.selection.clock_or_effect import still_blamed
from discrepancy.selection.state import Progress, Settings
from discrepancy.signals.findings import Findings
from discrepancy.signals.recording import Complaint, Recording


def examine(
    model: Model, recordings: Sequence[Recording], settings: Settings, progress: Progress = lambda _: None
) -> Findings:
    """The verdict on recordings, usable or not. Raises BadModel."""
    judged = investigate(model, recordings, settings, progress)
    return judged.findings if isinstance(judged, Judgement) else judged


def investigate(
    model: Model,
    recordings: Sequence[Recording],
    settings: Settings,
    progress: Progress = lambda _: None,
    complaints: Sequence[Complaint] = (),
) -> Judgement | Findings:
    """The verdict with the states behind it, or the findings alone if nothing is usable. complaints: from reading the recordings.

    A channel with a wrong scale, sign or clock is left out, with a complaint; the others are judged. Raises BadModel.
    """
    try:
        problem, failed = usable(model, recordings)
        averaged = settings.average or model.bandwidth_hz is not None
        problem, fast = at_bandwidth(problem) if averaged else (problem, [])
    except Unusable as error:
        names = list(dict.fromkeys([*(r.name for r in recordings), *(c.recording for c in complaints)]))
        return nothing_usable(model.name, names, Unusable([*complaints, *error.complaints]))
    jumps = [c for recording in recordings for find in (spikes, wrapped) for c in find(model, recording)]
    return judge(problem, settings, progress, [*complaints, *failed, *fast, *jumps])


def usable(model: Model, recordings: Sequence[Recording]) -> tuple[Problem, list[Complaint]]:
    """The problem without channels that fail their checks, and the complaints on those. Raises Unusable if nothing is left, BadModel."""
    problem = Problem(model, recordings)
    check_model(problem)
    failed = still_blamed(problem, failing_channels(problem))
    if not failed:
        return problem, []
    gone = {(c.recording, c.signal) for c in failed}
    kept = [
        replace(r, signals={name: s for name, s in r.signals.items() if (r.name, name) not in gone})
        for r in recordings
    ]
    try:
        return Problem(model, kept), failed
    except Unusable as error:
        # "no output is left" is a consequence of the failed channels and would hide their complaints
        left = [c for c in error.complaints if c.signal != OUTPUTS]
        raise Unusable([*failed, *left]) from error
