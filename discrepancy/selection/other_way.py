"""The search again with one accepted effect barred: whether others explain the recordings without it, and better.

The search takes one effect after the other, so that one which does a part of the work of two is taken before either of them. A lag in place of two
equal delays leaves both of them too little to be seen.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from discrepancy.estimation.fit import Fit, fit
from discrepancy.estimation.problem import Problem, Values
from discrepancy.selection.search import searched_on
from discrepancy.selection.state import Progress, Settings, State, free_names, switched_off


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
        off = state.fit.values.with_shared(switched_off(problem.model.effect(name)))
        less = problem.barring(name)
        without = _fitted(less, state, others, off)
        found, _ = searched_on(less, _of(state, others, without), brief, progress)
        if set(found.accepted) <= set(others):
            continue
        # under one noise: that of the state, which counts as noise what it does not explain
        other = _fitted(problem, state, found.accepted, found.fit.values)
        more = sum(problem.model.effect(n).size for n in found.accepted) - sum(
            problem.model.effect(n).size for n in state.accepted
        )
        if other.sse + settings.same * max(more, 0) < state.fit.sse:
            yield name, found


def _fitted(problem: Problem, state: State, accepted: Sequence[str], values: Values) -> Fit:
    return fit(problem, state.noise, free_names(problem, accepted), values)


def _of(state: State, accepted: tuple[str, ...], fitted: Fit) -> State:
    """What a search goes on from."""
    return State(state.noise, fitted, accepted, (), aside=state.aside)
