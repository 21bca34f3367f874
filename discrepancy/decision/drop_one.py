"""Drop-one tests: loss of fit and of held-out prediction when one accepted effect is removed and the rest is refitted."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from discrepancy import gates
from discrepancy.estimation.effort import AS_IT_IS, CACHED
from discrepancy.estimation.fit import Fit, fit
from discrepancy.estimation.problem import Mask, Problem, Values
from discrepancy.selection.active_intervals import active_interval_of, sse_threshold
from discrepancy.selection.assess import assess
from discrepancy.selection.candidate_fits import curves, held_out_residual, size_of
from discrepancy.selection.open_ended import OpenEnded
from discrepancy.selection.state import Settings, State, free_names, switched_off
from discrepancy.signals.recording import Array

NOTHING_KNOWN: Mapping[frozenset[str], Values] = {}


@dataclass(frozen=True, slots=True)
class DropOneTest:
    """The test of one accepted effect beside the others."""

    effect: str
    without: Fit  # with all other effects, refitted
    sse_reduction: float  # by the effect
    data_sse_reduction: float  # the same without priors, to be compared with held-out rows, which have none
    threshold: float  # of the reduction
    held_out_sse_reduction: float
    gap_closed: float  # share of the gap, on held-out rows, between the model without the effect and the best prediction
    error_ratio: dict[str, float]  # held-out error with the effect over that without, by channel
    # share of the squared held-out error of the channel that it improves most, while it acts
    gained: float


def backward(
    problem: Problem,
    state: State,
    settings: Settings,
    known: Mapping[frozenset[str], Values] = NOTHING_KNOWN,
) -> State:
    """The state without accepted effects that the others have made unnecessary, removed one by one, weakest first; known: as in `drop_one_tests`."""
    while len(state.accepted) > 1:
        fits = {}
        for name in state.accepted:
            others = tuple(n for n in state.accepted if n != name)
            fits[name] = _without(problem, state, others, known)
        weakest = min(fits, key=lambda n: fits[n].sse)
        effect = problem.model.effect(weakest)
        least = sse_threshold(problem, effect, state.fit.values, settings.alpha)
        if (
            fits[weakest].sse - state.fit.sse > least
            and size_of(effect, state.fit) >= problem.model.negligible
        ):
            break
        kept = tuple(n for n in state.accepted if n != weakest)
        state = replace(
            assess(problem, kept, fits[weakest].values, settings, state.aside),
            trials=state.trials,
        )
    return state


def _without(
    problem: Problem,
    state: State,
    others: tuple[str, ...],
    known: Mapping[frozenset[str], Values] = NOTHING_KNOWN,
) -> Fit:
    """The fit with only the effects `others`; known: values of the search by accepted effects, as starting points."""
    dropped = [problem.model.effect(name) for name in state.accepted if name not in others]
    off = {name: value for effect in dropped for name, value in switched_off(effect).items()}
    names = free_names(problem, others)
    here, before = state.fit.values.with_shared(off), known.get(frozenset(others))
    starts = [here] if before is None else [before.warmed_up_as(here), here]
    if not problem.costs.costly:
        # whichever of them ends lower: an effect that the search ended beside is not needed if the fit before it was better
        return min((fit(problem, state.noise, names, start) for start in starts), key=lambda end: end.sse)
    start = starts[0]
    # how much worse is the model without them, at the same values? That sets the accuracy that the refit needs
    unfitted = fit(problem, state.noise, names, start, effort=replace(AS_IT_IS, cached=True))
    least = problem.costs.least_reduction(unfitted.sse - state.fit.sse)
    return fit(problem, state.noise, names, start, effort=replace(CACHED, least_reduction=least))


def drop_one_tests(
    problem: Problem,
    state: State,
    known: Mapping[frozenset[str], Values],
    equation: OpenEnded,
    settings: Settings,
) -> list[DropOneTest]:
    """One test per accepted effect; known: values of the search by accepted effects."""
    if not state.accepted:
        return []
    found, after = [], dict[tuple[str, ...], Array]()
    for name in state.accepted:
        held = curves(problem, [other for other in state.accepted if other != name])
        if held not in after:
            after[held] = held_out_residual(
                problem, state.noise, state.accepted, state.fit.values, settings, held=held
            )
        found.append(_drop_one(problem, state, name, after[held], held, known, equation, settings))
    return found


def _drop_one(
    problem: Problem,
    state: State,
    name: str,
    after: Array,
    held: Sequence[str],
    known: Mapping[frozenset[str], Values],
    equation: OpenEnded,
    settings: Settings,
) -> DropOneTest:
    """The test of one effect; after: held-out residual with all accepted effects; held: those that keep their parameters in it."""
    others = tuple(n for n in state.accepted if n != name)
    without = _without(problem, state, others, known)
    least = problem.costs.least_reduction(without.sse - state.fit.sse)
    before = held_out_residual(
        problem, state.noise, others, without.values, settings, least_reduction=least, held=held
    )
    rows = {c: state.noise.row_channel == i for i, c in enumerate(problem.channels)}
    reductions = {c: float(np.sum(before[r] ** 2) - np.sum(after[r] ** 2)) for c, r in rows.items()}
    reduction = sum(reductions.values())
    # An error that is left in a channel which the effect does not move is no argument against the effect: such channels do not count.
    touched = [c for c, own in reductions.items() if own > gates.CHANNEL_TOUCHED.threshold * reduction]
    gap = reduction + sum(max(equation.held_out_sse_reductions.get(c, 0.0), 0.0) for c in touched)
    ratio = {
        c: float(np.sqrt(np.mean(after[r] ** 2) / np.mean(before[r] ** 2)))
        for c, r in rows.items()
        if r.any()
    }
    return DropOneTest(
        effect=name,
        without=without,
        sse_reduction=without.sse - state.fit.sse,
        data_sse_reduction=without.data_sse - state.fit.data_sse,
        threshold=sse_threshold(problem, problem.model.effect(name), state.fit.values, settings.alpha),
        held_out_sse_reduction=reduction,
        gap_closed=float(np.clip(reduction / gap, 0.0, 1.0)) if gap > 0.0 else 0.0,
        error_ratio=ratio,
        gained=_gained(before, after, rows.values(), _acting(problem, state, name)),
    )


def _acting(problem: Problem, state: State, name: str) -> Mask:
    """Whitened rows (n,) at which an accepted effect acts."""
    windows = active_interval_of(problem.model.effect(name), state.fit.values)
    rows = state.noise.row_window
    return np.ones(rows.size, bool) if windows is None else np.isin(rows, windows)


def _gained(before: Array, after: Array, channels: Iterable[Mask], acting: Mask) -> float:
    """The largest share over channels of the squares (n,) before that is gone after, of rows at which the effect acts; 0 or more."""
    sums = [
        (float(np.sum(before[own & acting] ** 2)), float(np.sum(after[own & acting] ** 2)))
        for own in channels
    ]
    return max((1.0 - with_it / without for without, with_it in sums if without > with_it), default=0.0)
