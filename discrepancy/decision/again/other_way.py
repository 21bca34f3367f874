"""The search again with one accepted effect barred: whether others explain the recordings without it, and better.

The search takes one effect after the other, so that one which does a part of the work of two is taken before either of them. A lag in place of two
equal delays leaves both of them too little to be seen.
"""

from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import replace
from typing import Final

from discrepancy.decision.judgement import Judgement
from discrepancy.estimation.fit import fit
from discrepancy.estimation.problem import Problem, Values
from discrepancy.selection.search import searched_on
from discrepancy.selection.state import Progress, Settings, State, free_names, switched_off

FIRST: Final = 3  # effects that are barred: what was accepted first had the most to stand in for


def other_way(
    first: Judgement,
    judged: Callable[[tuple[State, State]], Judgement],
    settings: Settings,
    progress: Progress,
) -> Judgement:
    """The verdict, or one that explains everything with other effects. judged: searches on from a state, beside that of the baseline."""
    if first.sheet.costs.costly or first.findings.status not in ("explained in part", "unknown"):
        return first
    # the problem that the state was fitted to: its priors count in what the two explain
    for _, state in other_ways(first.problem, first.state, first.state.accepted[:FIRST], settings, progress):
        second = judged((first.baseline, state))
        if second.findings.status == "explained":
            return second
    return first


def other_ways(
    problem: Problem,
    state: State,
    barred: Sequence[str],
    settings: Settings,
    progress: Progress = lambda _: None,
) -> Iterator[tuple[str, State]]:
    """Each of the accepted effects `barred`, with the state of a search without it, where others then explain more than it did with them."""
    if len(problem.model.effects) == len(state.accepted):
        return
    # a name in place of two: more would describe the misfit of a wrong model, not the machine
    brief = replace(settings, most_effects=min(len(state.accepted) + 1, settings.most_effects))
    for name in barred:
        progress(f"searching again without {name}")
        others = tuple(n for n in state.accepted if n != name)
        begin = replace(state, accepted=others, fit=replace(state.fit, values=_off(problem, state, name)))
        found, _ = searched_on(_barring(problem, name), begin, brief, progress)
        if set(found.accepted) <= set(others):
            continue
        # under one noise: that of the state, which counts as noise what it does not explain
        other = fit(problem, state.noise, free_names(problem, found.accepted), found.fit.values)
        # a further parameter has to bring what two equally good fits may differ by
        further = len(other.names) - len(state.fit.names)
        if other.sse + settings.same * max(further, 0) < state.fit.sse:
            yield name, found


def _off(problem: Problem, state: State, name: str) -> Values:
    """The values without an effect: it may come again, and act at another time."""
    off, values = switched_off(problem.model.effect(name)), state.fit.values
    elsewhere = {n: windows for n, windows in values.active_intervals.items() if n not in off}
    return replace(values.with_shared(off), active_intervals=elsewhere)


def _barring(problem: Problem, effect: str) -> Problem:
    """A copy whose library has not this effect; it shares the cached Jacobian columns."""
    less = copy(problem)
    less.model = replace(problem.model, effects=tuple(e for e in problem.model.effects if e.name != effect))
    return less
