"""When a temporary effect begins and ends: windows are cut finer there, and all is judged again.

An effect acts in whole windows. Where it begins within one, that window is simulated wrong: the effect's size is pulled, and another effect may be
found that does the rest.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from discrepancy.decision.judgement import Judgement
from discrepancy.estimation.problem import Problem
from discrepancy.model.windows import FEWEST_SAMPLES
from discrepancy.selection.active_intervals import active_interval_of, runs
from discrepancy.selection.state import Progress
from discrepancy.signals import findings as f

# Shorter parts do not narrow it further: the initial state of each is free, and takes up the step that would show.
PARTS: Final = 4  # of a window, where an effect may begin or end
ORDER: Final[tuple[f.Status, ...]] = (
    "inconclusive",
    "nothing missing",
    "unknown",
    "explained in part",
    "explained",
)


def with_times(first: Judgement, judged: Callable[[Problem], Judgement], progress: Progress) -> Judgement:
    """The verdict, or that with finer windows where temporary effects begin and end, if they are found there again and it says no less."""
    ends = dict(_ends(first))
    if first.sheet.costs.costly or not ends:
        return first
    progress(f"narrowing down when {' and '.join(_temporary(first.findings))} begins and ends")
    second = judged(first.sheet.cut_at(ends))
    kept = first if _says_less(second.findings, first.findings) else second
    both = first.findings.simulations + second.findings.simulations
    return replace(kept, findings=replace(kept.findings, simulations=both))


def _temporary(found: f.Findings) -> dict[str, set[str]]:
    """Temporary effects, and the groups that they are in."""
    return {x.effect: {*x.members} for x in found.findings if x.where.temporary}


def _says_less(second: f.Findings, first: f.Findings) -> bool:
    """Whether a temporary effect is not found again or in a larger group, or the verdict is a weaker one: short windows may hide what distinguishes two effects."""
    before, after = _temporary(first), _temporary(second)
    lost = any(name not in after or after[name] - members for name, members in before.items())
    return lost or ORDER.index(second.status) < ORDER.index(first.status)


def _ends(judgement: Judgement) -> Iterator[tuple[str, Sequence[float]]]:
    """By recording, the times that cut the windows on both sides of each end of a temporary effect [s]; none where they would get too short."""
    problem, state = judgement.problem, judgement.state
    beside: set[int] = set()
    for name in state.accepted:
        active = active_interval_of(problem.model.effect(name), state.fit.values)
        limits = [limit for run in runs(problem, active or ()) for limit in (run.start, run.stop)]
        beside |= {w for limit in limits if _within(problem, limit) for w in (limit - 1, limit)}
    found: dict[str, list[float]] = {}
    for i in sorted(beside):
        window = problem.windows[i]
        fewest = min(b.sample_s.size for b in problem.blocks if b.window == i)
        if fewest >= PARTS * FEWEST_SAMPLES:
            edges = np.linspace(window.start_s, window.end_s, PARTS + 1)[1:-1]
            found.setdefault(window.recording, []).extend(edges.tolist())
    yield from found.items()


def _within(problem: Problem, limit: int) -> bool:
    """Whether the windows on both sides of a limit are there, and of one recording."""
    windows = problem.windows
    return 0 < limit < len(windows) and windows[limit - 1].recording == windows[limit].recording
