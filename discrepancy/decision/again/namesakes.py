"""Findings that would get the same name: one effect explains two of them better than they themselves do, each in its place."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from discrepancy.decision.drop_one import backward
from discrepancy.decision.groups import Alternative
from discrepancy.estimation.problem import Problem
from discrepancy.selection.assess import assess
from discrepancy.selection.state import Settings, State


def without_namesakes(
    problem: Problem, state: State, rivals: Sequence[Sequence[Alternative]], settings: Settings
) -> State | None:
    """The state with that one effect in the place of the finding that it replaces best, and without what it then makes needless; None if every best name is there once.

    rivals: by accepted effect, in their order, its alternatives, best first.
    """
    # The search takes one effect after the other. Two wrong ones together may have stood in for a right one before other misfits were out.
    names = Counter(ranked[0].effect for ranked in rivals)
    twice = [
        (ranked[0].difference, own, ranked[0])
        for own, ranked in zip(state.accepted, rivals, strict=True)
        if names[ranked[0].effect] > 1 and ranked[0].effect != own
    ]
    if not twice:
        return None
    _, replaced, best = min(twice, key=lambda swap: swap[0])
    accepted = tuple(best.effect if name == replaced else name for name in state.accepted)
    swapped = assess(problem, accepted, best.fit.values, settings, state.aside)
    return backward(problem, replace(swapped, trials=state.trials), settings)


def apart(rivals: Sequence[Sequence[Alternative]]) -> list[list[Alternative]]:
    """The alternatives of each finding, with another one first where the best name is that of a finding that it suits better."""
    found = [list(ranked) for ranked in rivals]
    taken = set[str]()
    for ranked in sorted(found, key=lambda ranked: ranked[0].difference):
        # what was accepted is there once, so that every finding keeps a name
        own = next(i for i, a in enumerate(ranked) if a.effect not in taken)
        taken.add(ranked[own].effect)
        ranked[:] = ranked[own:]
    return found
