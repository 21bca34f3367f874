"""What every accepted effect is worth beside the others: what goes when it goes, in the fit and on rows that were not fitted."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from discrepancy.assess import assess
from discrepancy.fit import Fit, fit
from discrepancy.openended import OpenEnded
from discrepancy.problem import Problem, Values
from discrepancy.recording import Array
from discrepancy.spells import price
from discrepancy.state import Settings, State, free_names
from discrepancy.trials import held_out_residual, near, size_of

NOTHING_KNOWN: Mapping[frozenset[str], Values] = {}
TOUCHED = 0.1  # share of the gain that makes a channel one the effect acts on


@dataclass(frozen=True, slots=True)
class Needed:
    """An accepted effect, the fit without it, its gain, and the share of the gap it closes on held-out rows; seen: the gain without priors,

    which held-out rows do not know of.
    """

    effect: str
    without: Fit
    gain: float
    seen: float
    needed: float
    held_out_gain: float
    gap_closed: float
    error_ratio: dict[str, float]


def backward(problem: Problem, state: State, settings: Settings) -> State:
    """Drop accepted effects that the others have made superfluous, weakest first."""
    while len(state.accepted) > 1:
        gains = {}
        for name in state.accepted:
            others = tuple(n for n in state.accepted if n != name)
            gains[name] = _without(problem, state, others).sse - state.fit.sse
        weakest = min(gains, key=lambda n: gains[n])
        least = price(problem, problem.model.effect(weakest), state.fit.values, settings.alpha)
        size = size_of(problem.model.effect(weakest), state.fit)
        if gains[weakest] > least and size >= problem.model.negligible:
            break
        kept = tuple(n for n in state.accepted if n != weakest)
        state = replace(
            assess(problem, kept, _without(problem, state, kept).values, settings), trials=state.trials
        )
    return state


def _without(
    problem: Problem,
    state: State,
    others: tuple[str, ...],
    known: Mapping[frozenset[str], Values] = NOTHING_KNOWN,
) -> Fit:
    """The fit with only `others` on, the rest switched off again; known: where the search stood with which effects, to begin from."""
    off = {
        p.name: p.value
        for name in state.accepted
        if name not in others
        for p in problem.model.effect(name).parameters
    }
    names = free_names(problem, others)
    start, enough = known.get(frozenset(others), state.fit.values.with_shared(off)), None
    if problem.model.costly:
        begun = fit(problem, state.noise, names, start, rough=True, iterations=0)
        enough = near(problem, begun.sse - state.fit.sse)
    return fit(problem, state.noise, names, start, rough=True, enough=enough)


def beside_others(
    problem: Problem,
    state: State,
    known: Mapping[frozenset[str], Values],
    beyond: OpenEnded,
    settings: Settings,
) -> list[Needed]:
    """Every accepted effect, weighed beside the others."""
    if not state.accepted:
        return []
    after = held_out_residual(problem, state.noise, state.accepted, state.fit.values, settings)
    return [_weigh(problem, state, name, after, known, beyond, settings) for name in state.accepted]


def _weigh(
    problem: Problem,
    state: State,
    name: str,
    after: Array,
    known: Mapping[frozenset[str], Values],
    beyond: OpenEnded,
    settings: Settings,
) -> Needed:
    """after: the held-out residual with all that was accepted."""
    others = tuple(n for n in state.accepted if n != name)
    without = _without(problem, state, others, known)
    enough = near(problem, without.sse - state.fit.sse)
    before = held_out_residual(problem, state.noise, others, without.values, settings, enough=enough)
    rows = {c: state.noise.row_channel == i for i, c in enumerate(problem.channels)}
    gains = {c: float(np.sum(before[r] ** 2) - np.sum(after[r] ** 2)) for c, r in rows.items()}
    gained = sum(gains.values())
    # what is left in channels the effect does not touch says nothing about it
    touched = [c for c, gain in gains.items() if gain > TOUCHED * gained]
    gap = gained + sum(max(beyond.held_out_gains.get(c, 0.0), 0.0) for c in touched)
    ratio = {
        c: float(np.sqrt(np.mean(after[r] ** 2) / np.mean(before[r] ** 2)))
        for c, r in rows.items()
        if r.any()
    }
    return Needed(
        effect=name,
        without=without,
        gain=without.sse - state.fit.sse,
        seen=without.data_sse - state.fit.data_sse,
        needed=price(problem, problem.model.effect(name), state.fit.values, settings.alpha),
        held_out_gain=gained,
        gap_closed=float(np.clip(gained / gap, 0.0, 1.0)) if gap > 0.0 else 0.0,
        error_ratio=ratio,
    )
