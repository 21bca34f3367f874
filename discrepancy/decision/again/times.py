"""When a temporary effect begins and ends: looked for in finer windows, where windows are then cut, and all is judged again.

An effect acts in whole windows. Where it begins within one, that window is simulated wrong: the effect's size is pulled, and another effect may be
found that does the rest.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from discrepancy import gates
from discrepancy.decision.judgement import Judgement
from discrepancy.estimation.problem import Problem, Windows
from discrepancy.model.windows import FEWEST_SAMPLES
from discrepancy.selection.active_intervals import active_interval_of, runs
from discrepancy.selection.search import search
from discrepancy.selection.state import Progress, Settings, State
from discrepancy.signals import findings as f

# Shorter parts do not narrow it further: the initial state of each is free, and takes up the step that would show.
PARTS: Final = 4  # of a window, where an effect may begin or end
ORDER: Final[tuple[f.Status, ...]] = ("inconclusive", "nothing missing", "unknown", "explained in part", "explained")  # fmt: skip

Edges = dict[str, list[float]]
"""Times [s] by recording."""


def with_times(
    first: Judgement, judged: Callable[[Problem], Judgement], settings: Settings, progress: Progress
) -> Judgement:
    """The verdict, or that of windows that are cut where temporary effects begin and end, unless it says less or simulates worse. Where none of them is named, its times are not worth a search.

    The times are those of a search in quarters of the windows beside. These are whole again for the verdict: the initial state of a short window is free and hides
    what distinguishes two effects. An effect that was there only for what a wrong time left over may be gone.
    """
    problem = first.sheet
    named = any(x.named and x.where.temporary for x in first.findings.findings)
    beside = _in_parts(problem, _limits(problem, first.state)) if named and not problem.costs.costly else {}
    if not beside:
        return first
    progress(f"narrowing down when {' and '.join(_temporary(problem, first.state))} begins and ends")
    finer = problem.again(edges=beside)
    state, _ = search(finer, settings, progress)
    times: Edges = {}
    for limit in _limits(finer, state):
        times.setdefault(finer.windows[limit].recording, []).append(finer.windows[limit].start_s)
    cut = problem.again(edges=times)
    if len(cut.windows) == len(problem.windows):
        return first
    second = judged(cut)
    kept = first if _says_less(second.findings, first.findings) else second
    cost = first.findings.simulations + finer.simulations + second.findings.simulations
    return replace(kept, findings=replace(kept.findings, simulations=cost))


def _temporary(problem: Problem, state: State) -> dict[str, Windows]:
    """Accepted effects that act for a part of the time, and the windows in which they do."""
    acting = {n: active_interval_of(problem.model.effect(n), state.fit.values) for n in state.accepted}
    return {name: windows for name, windows in acting.items() if windows is not None}


def _limits(problem: Problem, state: State) -> list[int]:
    """The windows with which accepted effects begin to act, or to act no more, other than the first of a recording."""
    spells = [run for windows in _temporary(problem, state).values() for run in runs(problem, windows)]
    return sorted({i for run in spells for i in (run.start, run.stop) if _within(problem, i)})


def _within(problem: Problem, limit: int) -> bool:
    """Whether the windows on both sides of a limit are there, and of one recording."""
    windows = problem.windows
    return 0 < limit < len(windows) and windows[limit - 1].recording == windows[limit].recording


def _in_parts(problem: Problem, limits: Iterable[int]) -> Edges:
    """The times that cut the windows on both sides of each limit in parts, without windows whose parts would be too short."""
    found: Edges = {}
    for i in sorted({w for limit in limits for w in (limit - 1, limit)}):
        window = problem.windows[i]
        fewest = min(b.sample_s.size for b in problem.blocks if b.window == i)
        if fewest >= PARTS * FEWEST_SAMPLES:
            edges = np.linspace(window.start_s, window.end_s, PARTS + 1)[1:-1]
            found.setdefault(window.recording, []).extend(edges.tolist())
    return found


def _says_less(second: f.Findings, first: f.Findings) -> bool:
    """Whether the verdict is a weaker one, a channel is simulated worse, or an effect is in a larger group."""
    weaker = ORDER.index(second.status) < ORDER.index(first.status)
    before = {c.channel: c.simulated for c in first.adequacy}
    worse = any(
        c.simulated > gates.SIMULATED_WORSE.threshold * before.get(c.channel, np.inf) for c in second.adequacy
    )
    return weaker or worse or _less_distinct(second.findings, first.findings)


def _less_distinct(second: Sequence[f.Finding], first: Sequence[f.Finding]) -> bool:
    members = {x.effect: {*x.members} for x in first}
    return any({*x.members} - members.get(x.effect, {*x.members}) for x in second)
