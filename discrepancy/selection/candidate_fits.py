"""Fits each effect of the shortlist beside the accepted ones, and confirms it on data that were not fitted.

Scores are linear and assume all else fixed; only a refit of everything shows how much an effect reduces the SSE.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from discrepancy import gates
from discrepancy.estimation.effort import BEHIND, BRIEF, FIRST_STEPS, TRAINING, Effort
from discrepancy.estimation.fit import Fit, Mask, fit, held_out
from discrepancy.estimation.noise import Noise
from discrepancy.estimation.normal_equations import inverse
from discrepancy.estimation.problem import Problem, Values, Windows
from discrepancy.model.description import Effect
from discrepancy.selection.active_intervals import (
    active_interval_of,
    refine_interval,
    restricted_to,
    sse_threshold,
)
from discrepancy.selection.assess import screen
from discrepancy.selection.screen import Score, penalty, spread, time_blocks, time_blocks_of
from discrepancy.selection.starts import Start, Starts
from discrepancy.selection.state import CandidateFit, Settings, State, free_names
from discrepancy.signals.recording import Array

CLEAR: Final = gates.CLEAR.threshold
SURE: Final = 1.96  # standard deviations, 95 %
LONGER: Final = Effort(iterations=6)


def try_shortlist(problem: Problem, state: State, settings: Settings) -> list[CandidateFit]:
    """Candidate fits of the shortlist, confirmed on held-out data; if none is confirmed, also of the next best by score."""
    listed = shortlisted(problem.model.effects, state.scores, settings)
    trials = _fits(problem, state, listed, state.temporary[: settings.shortlist // 2], settings)
    if any(t.accepted(settings) for t in trials):
        return trials
    known = {t.effect for t in trials} | {s.effect for s in listed}
    count = len(problem.model.effects)
    rest = [
        s
        for s in state.scores
        if s.effect not in known and s.statistic > penalty(s.freedom, count, settings.alpha)
    ]
    return trials + _fits(problem, state, rest[: settings.shortlist], (), settings)


def _fits(
    problem: Problem,
    state: State,
    listed: Sequence[Score],
    temporary: Sequence[tuple[Score, Windows]],
    settings: Settings,
) -> list[CandidateFit]:
    """A fit of each of these effects beside the accepted ones; temporary: effects that may act in some windows only."""
    # an effect that scores best in one interval may still act throughout: try both
    named = {s.effect for s in listed}
    listed = [*listed, *(s for s, _ in temporary if s.effect not in named)]
    points = Starts(problem, state.noise, state.fit, state.columns, state.at_prior)
    started = [(s, points.of(s, None)) for s in listed]
    most = max((begin[0].sse_reduction for _, begin in started), default=0.0)
    # expensive models: candidates far behind are tried after clear ones are accepted
    least = problem.costs.worth_starting(most, CLEAR)
    started = [b for b in started if max(b[0].raw_statistic, b[1][0].sse_reduction) > least]
    first_fits = [first_steps(problem, state, s, begin) for s, begin in started]
    most = max((state.fit.sse - fits[0].sse for fits in first_fits), default=0.0)
    least = BEHIND * most if most > CLEAR else -np.inf
    trials = [
        finished(problem, state, s, fits, settings, least)
        for (s, _), fits in zip(started, first_fits, strict=True)
    ]
    trials += _temporary_fits(problem, state, temporary, settings)
    return _confirmed(problem, state, trials, settings)


def _confirmed(
    problem: Problem, state: State, trials: Sequence[CandidateFit], settings: Settings
) -> list[CandidateFit]:
    """The fits; those that pass get their held-out reduction, the best ones first and only until one is confirmed: it costs as much as a fit."""
    fine = [i for i, t in enumerate(trials) if t.passes and t.size >= problem.model.negligible]
    # judged under a noise of their own, so that their margins do not compare
    tested = list(trials)
    for i in [i for i in fine if trials[i].reference]:
        tested[i] = confirm(problem, trials[i].reference or state, trials[i], settings)
    left = [i for i in fine if not trials[i].reference]
    while left:
        # The best by reduction may be one that held-out data contradict. Those behind it then get their turn.
        best = max(trials[i].margin for i in left)
        near = [i for i in left if trials[i].margin > best - 3.0 * settings.same]
        least = problem.costs.least_reduction(min(trials[i].sse_reduction for i in near))
        before = held_out_residual(
            problem,
            state.noise,
            state.accepted,
            state.fit.values,
            settings,
            least_reduction=least,
            held=curves(problem, state.accepted),
        )
        for i in near:
            tested[i] = confirm(problem, state, trials[i], settings, before)
        if any(tested[i].accepted(settings) and not tested[i].negligible(problem) for i in near):
            break
        left = [i for i in left if i not in near]
    return tested


def shortlisted(model_effects: Sequence[Effect], scores: Sequence[Score], settings: Settings) -> list[Score]:
    """The best effects by score, and the partner of every lag or delay among them: to first order both give the same score."""
    half, least = settings.shortlist // 2, gates.WORTH_A_FIT.threshold
    leading = list(scores[:half])
    # the variance inflation may be overestimated while effects are missing: the best before the division by it are tried as well
    unscaled = sorted((s for s in scores[half:]), key=lambda s: -s.raw_statistic)[: settings.shortlist - half]
    best = [s for s in leading + unscaled if s.raw_statistic > least]
    named = {s.effect for s in best}
    partners = {
        swapped
        for name in named
        for swapped in (name.replace(" lag", " delay"), name.replace(" delay", " lag"))
        if swapped not in named
    }
    return best + [s for s in scores if s.effect in partners]


def _temporary_fits(
    problem: Problem, state: State, temporary: Sequence[tuple[Score, Windows]], settings: Settings
) -> list[CandidateFit]:
    """Fits of temporary effects and of their rivals in the same windows, started under the noise with which they were scored."""
    if not temporary or state.temporary_basis is None:
        return []
    noise, fitted = state.temporary_basis
    seen = replace(state, noise=noise, fit=fitted)
    points = Starts(problem, noise, fitted, state.columns, state.at_prior)
    trials = [_temporary_fit(problem, seen, s, points, windows, settings) for s, windows in temporary]
    return trials + _in_the_same_windows(problem, seen, trials, points, settings)


def _in_the_same_windows(
    problem: Problem, state: State, trials: Sequence[CandidateFit], points: Starts, settings: Settings
) -> list[CandidateFit]:
    """Fits of the likeliest other effects in the windows of the best temporary effect, under the noise beside that effect."""
    brief = [t for t in trials if t.reference and t.passes]
    if not brief:
        return []
    best = max(brief, key=lambda t: t.sse_reduction)
    windows = active_interval_of(problem.model.effect(best.effect), best.fit.values)
    assert windows is not None
    assert best.reference is not None
    tried = {t.effect for t in trials if t.reference}
    others = [c for c in state.columns if c.effect.size == 1 and c.effect.name not in tried]
    columns = restricted_to(problem, others, windows)
    scores = screen(problem, best.reference.noise, best.reference.fit, columns, settings)
    likely = [s for s in scores if s.statistic > best.threshold][: settings.shortlist // 2]
    return [_temporary_fit(problem, state, s, points, windows, settings) for s in likely]


def _temporary_fit(
    problem: Problem, state: State, found: Score, points: Starts, windows: Windows, settings: Settings
) -> CandidateFit:
    """The fit of a temporary effect, starting with these windows; windows, size and noise are then estimated together."""
    first_fits = first_steps(problem, state, found, points.of(found, windows))
    effect, names = problem.model.effect(found.effect), free_names(problem, state.accepted)
    best = _completed(problem, state, effect, first_fits, settings, -np.inf)
    least = sse_threshold(problem, effect, best.values, settings.alpha)
    own = refine_interval(problem, state.noise, effect, names, best.values, windows, state.columns, least)
    uniform = own.uniform(settings.alpha / len(problem.model.effects))
    return CandidateFit(
        effect.name,
        own.with_it,
        # an effect that comes and goes within its interval is another effect: it must not pass
        sse_reduction=own.sure_sse_reduction if uniform else 0.0,
        raw_sse_reduction=own.sse_reduction,
        threshold=sse_threshold(problem, effect, own.with_it.values, settings.alpha),
        variance_inflation=own.variance_inflation,
        size=size_of(effect, own.with_it),
        reference=replace(state, noise=own.noise, fit=own.without),
    )


def first_steps(problem: Problem, state: State, found: Score, begin: Sequence[Start]) -> list[Fit]:
    """Fits with one more effect after their first steps, one from each start, best first."""
    # A clear score with no better fit means that the cached Jacobian columns were wrong here: repeat without them.
    names = free_names(problem, (*state.accepted, found.effect))
    fits = [fit(problem, state.noise, names, start.values, effort=FIRST_STEPS) for start in begin]
    if all(f.sse > state.fit.sse for f in fits) and found.raw_statistic > CLEAR:
        fits = [fit(problem, state.noise, names, begin[0].values, effort=LONGER)]
    return sorted(fits, key=lambda f: f.sse)


def finished(
    problem: Problem, state: State, found: Score, first_fits: Sequence[Fit], settings: Settings, least: float
) -> CandidateFit:
    """The non-linear fit with one more effect; completed if its first steps reduced the SSE by more than `least`."""
    effect = problem.model.effect(found.effect)
    best = _completed(problem, state, effect, first_fits, settings, least)
    trial = candidate_fit(problem, state, effect, best, settings)
    if not trial.passes or trial.size >= problem.model.negligible:
        return trial
    # Significant, but perhaps of negligible size. A nuisance that does nearly the same makes the SSE a long valley; with derivatives
    # of another point the steps stop short of its end, so repeat with derivatives of this point.
    problem.jacobian.forget_derivatives()
    return candidate_fit(problem, state, effect, fit(problem, state.noise, best.names, best.values), settings)


def _completed(
    problem: Problem,
    state: State,
    effect: Effect,
    first_fits: Sequence[Fit],
    settings: Settings,
    least: float,
) -> Fit:
    """The best completed fit; the best first fit unchanged, if none is worth completing."""
    best = first_fits[0]
    threshold = sse_threshold(problem, effect, best.values, settings.alpha)
    if state.fit.sse - best.sse <= max(least, problem.costs.worth_finishing(threshold)):
        return best
    fits: list[Fit] = []
    for first in first_fits:
        if not any(_one_place(problem, first, ended) for ended in fits):
            fits.append(fit(problem, state.noise, best.names, first.values, effort=BRIEF))
    return min(fits, key=lambda f: f.sse)


def _one_place(problem: Problem, one: Fit, other: Fit) -> bool:
    """Whether two fits of the same parameters are within a typical change of each other, so that both end at the same point."""
    apart = [one.values.shared[name] - other.values.shared[name] for name in one.names]
    typical = [problem.model.parameter(name).typical for name in one.names]
    return bool(np.max(np.abs(apart) / np.abs(typical)) < 1.0)


def candidate_fit(
    problem: Problem, state: State, effect: Effect, fitted: Fit, settings: Settings
) -> CandidateFit:
    """The candidate of a fit with one effect more than the state: SSE reduction over its variance inflation, threshold and size."""
    raw = state.fit.sse - fitted.sse
    inflation = spread(fitted, effect.amplitude_names, time_blocks_of(state.noise))
    return CandidateFit(
        effect.name,
        fitted,
        sse_reduction=raw / inflation,
        raw_sse_reduction=raw,
        threshold=sse_threshold(problem, effect, fitted.values, settings.alpha),
        variance_inflation=inflation,
        size=size_of(effect, fitted),
    )


def size_of(effect: Effect, fitted: Fit) -> float:
    """Smallest size of an effect that its 95 % interval allows, as that of its largest amplitude parameter in typical changes."""
    # All amplitudes are moved towards zero together, until the Wald statistic of the distance is that of 95 %.
    own = effect.amplitude_parameters
    distance = np.array([fitted.values.shared[p.name] - p.value for p in own])
    sure = float(distance @ shapes_held(effect, fitted) @ distance)
    left = max(1.0 - SURE / np.sqrt(sure), 0.0) if sure > 0.0 else 0.0
    return left * float(np.max(np.abs(distance) / np.abs([p.typical for p in own])))


def shapes_held(effect: Effect, fitted: Fit) -> Array:
    """Information (k, k) on the k amplitude parameters of an effect, its shapes held: whether it is there, not how large each is.

    A recording at one speed leaves the growth of a resistance with speed open, and with it the resistance at rest, but not that there is one.
    """
    own = effect.amplitude_names
    at = [fitted.names.index(name) for name in own]
    at += [fitted.names.index(p.name) for p in effect.parameters if p.shape and p.name in fitted.names]
    return inverse(fitted.covariance[np.ix_(at, at)])[: len(own), : len(own)]


def confirm(
    problem: Problem, state: State, trial: CandidateFit, settings: Settings, without: Array | None = None
) -> CandidateFit:
    """The candidate with its SSE reduction on held-out rows, summed over the folds; shared parameters are fitted to the other rows.

    without: the held-out residual of the state itself, where it is known.
    """
    noise, count, held = state.noise, len(problem.channels), curves(problem, state.accepted)
    if without is None:
        least = problem.costs.least_reduction(trial.sse_reduction)
        without = held_out_residual(
            problem, noise, state.accepted, state.fit.values, settings, least_reduction=least, held=held
        )
    with_it = held_out_residual(
        problem, noise, (*state.accepted, trial.effect), trial.fit.values, settings, held=held
    )
    gained, whole = without**2 - with_it**2, np.bincount(noise.row_channel, without**2, count)
    taken = np.bincount(noise.row_channel, gained, count) / np.maximum(whole, 1e-300)
    return replace(trial, held_out_sse_reduction=float(np.sum(gained)), explained=float(np.max(taken)))


def held_out_residual(
    problem: Problem,
    noise: Noise,
    effects: Sequence[str],
    start: Values,
    settings: Settings,
    *,
    least_reduction: float = 0.0,
    held: Sequence[str] = (),
) -> Array:
    """Whitened residual (n,): every row from shared parameters that were fitted without it; further arguments as of `cross_validated`."""
    residual = np.empty(noise.keep.size)
    folds_of = cross_validated(
        problem, noise, effects, start, settings, least_reduction=least_reduction, held=held
    )
    for test, judged in folds_of:
        residual[test] = judged.residual[test]
    return residual


def cross_validated(
    problem: Problem,
    noise: Noise,
    effects: Sequence[str],
    start: Values,
    settings: Settings,
    *,
    least_reduction: float = 0.0,
    held: Sequence[str] = (),
) -> Iterator[tuple[Mask, Fit]]:
    """Held-out rows of each fold, with the fit whose shared parameters come from the other rows.

    least_reduction: of Effort; held: those of `effects` that keep the parameters of `start`.
    """
    fixed = {name for effect in held for name in problem.model.effect(effect).names}
    names = tuple(name for name in free_names(problem, effects) if name not in fixed)
    effort = replace(TRAINING, least_reduction=least_reduction)
    for test in folds(problem, noise, settings.folds):
        trained = fit(problem, noise, names, start, rows=~test, effort=effort)
        yield test, held_out(problem, noise, trained.values, test)


def curves(problem: Problem, accepted: Sequence[str]) -> tuple[str, ...]:
    """Accepted effects that are curves: they are held while another effect is tested on held-out data.

    Where a fold lacks a speed, it does not know the curve there. What it makes of it would decide on every other effect.
    """
    return tuple(name for name in accepted if problem.model.effect(name).is_profile)


def folds(problem: Problem, noise: Noise, count: int) -> list[Mask]:
    """Masks of the rows held out in turn: every count-th window, or blocks of time where there are few windows."""
    # Alternating windows: both halves then contain every way of driving, as a recording split in the middle would not.
    number: NDArray[np.intp] = noise.row_window
    if problem.model.held_out_s is not None:
        number = (noise.row_time // problem.model.held_out_s).astype(np.intp)
    elif len(problem.windows) < 2 * count:
        number = time_blocks(noise, 4 * count) if len(problem.windows) < count else number
    return [number % count == i for i in range(count)]


def project_out(fitted: Fit, kept: Sequence[int]) -> Array:
    """Columns `kept` of a fit, orthogonal to its other columns."""
    others = [i for i in range(len(fitted.names)) if i not in kept]
    X, J = fitted.columns[:, list(kept)], fitted.columns[:, others]
    if not others:
        return X
    return X - J @ np.linalg.lstsq(J, X, rcond=None)[0]
