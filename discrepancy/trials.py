"""Effects put to the test: refitted beside what is accepted, weighed, and confirmed on data that were not fitted."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from discrepancy.assess import screen
from discrepancy.fit import Fit, Mask, fit, held_out
from discrepancy.model import Effect
from discrepancy.noise import Noise
from discrepancy.normal import inverse
from discrepancy.problem import Problem, Values
from discrepancy.recording import Array
from discrepancy.screen import Score, active, penalty, spread, stretches, switches, time_blocks
from discrepancy.spells import price, settle, spell_of, within
from discrepancy.starts import Starts
from discrepancy.state import CLEAR, Settings, State, Trial, free_names

NEAR = 0.02  # share of an effect's gain to which it is known what a costly model leaves without the effect
BEHIND = 0.25  # share of the largest gain in SSE below which a begun refit is left, where that gain is
REACH = 0.5  # share of the gain that is needed, below which a begun refit of a costly model is left
SURE = 1.96  # standard deviations


def try_shortlist(problem: Problem, state: State, settings: Settings) -> list[Trial]:
    """Refit the shortlist; put those that gain enough to the held-out test. Where none passes, what else scores enough has its turn."""
    listed = shortlisted(problem.model.effects, state.scores, settings)
    trials = _tried(problem, state, listed, state.passing[: settings.shortlist // 2], settings)
    if any(t.accepted(settings) for t in trials):
        return trials
    known = {t.effect for t in trials} | {s.effect for s in listed}
    count = len(problem.model.effects)
    rest = [
        s
        for s in state.scores
        if s.effect not in known and s.statistic > penalty(s.freedom, count, settings.alpha)
    ]
    return trials + _tried(problem, state, rest[: settings.shortlist], (), settings)


def _tried(
    problem: Problem,
    state: State,
    listed: Sequence[Score],
    passing: Sequence[tuple[Score, range]],
    settings: Settings,
) -> list[Trial]:
    """Each of these as it does in a refit; passing: effects that may act in some windows only."""
    # what seems to act for a while may act always
    named = {s.effect for s in listed}
    listed = [*listed, *(s for s, _ in passing if s.effect not in named)]
    points = Starts(problem, state.noise, state.fit, state.columns, state.unstrained)
    begins = [(s, points.of(s, None)) for s in listed]
    most = max((start[0][1] for *_, start in begins), default=0.0)
    # of costly models: what is far behind by its score and where it starts has its turn when what is beyond doubt has been taken in
    least = BEHIND * most if most > CLEAR and problem.model.costly else -np.inf
    begins = [b for b in begins if max(b[0].statistic * b[0].inflation, b[1][0][1]) > least]
    begun = [begin(problem, state, s, start) for s, start in begins]
    most = max((state.fit.sse - b[0].sse for b in begun), default=0.0)
    least = BEHIND * most if most > CLEAR else -np.inf
    trials = [
        refit(problem, state, s, b, settings, least, None) for (s, _), b in zip(begins, begun, strict=True)
    ]
    trials += _briefly(problem, state, passing, settings)
    sure = [t.gain > t.needed and t.size >= problem.model.negligible for t in trials]
    best = max((t.lead for t, fine in zip(trials, sure, strict=True) if fine and not t.beside), default=0.0)
    tested = [
        fine and (t.beside is not None or t.lead > best - 3.0 * settings.same)
        for t, fine in zip(trials, sure, strict=True)
    ]
    gains = [t.gain for t, test in zip(trials, tested, strict=True) if test and t.beside is None]
    before = (
        held_out_residual(
            problem, state.noise, state.accepted, state.fit.values, settings, enough=near(problem, min(gains))
        )
        if gains
        else None
    )
    return [
        confirm(problem, t.beside or state, t, settings, None if t.beside else before) if test else t
        for t, test in zip(trials, tested, strict=True)
    ]


def shortlisted(model_effects: Sequence[Effect], scores: Sequence[Score], settings: Settings) -> list[Score]:
    """The best by score, and the partner of every lag or delay among them: their first-order scores are the same."""
    half = settings.shortlist // 2
    sure = list(scores[:half])
    # a doubtful noise estimate must not keep an effect from being tried: the best before inflation come too
    loud = sorted((s for s in scores[half:]), key=lambda s: -s.statistic * s.inflation)[
        : settings.shortlist - half
    ]
    best = [s for s in sure + loud if s.statistic * s.inflation > 3.0]
    named = {s.effect for s in best}
    partners = {
        swapped
        for name in named
        for swapped in (name.replace(" lag", " delay"), name.replace(" delay", " lag"))
        if swapped not in named
    }
    return best + [s for s in scores if s.effect in partners]


def _briefly(
    problem: Problem, state: State, passing: Sequence[tuple[Score, range]], settings: Settings
) -> list[Trial]:
    """Those that may act for a while, and their rivals in the same windows, begun under the noise by which they were seen."""
    if not passing or state.seen_under is None:
        return []
    noise, fitted = state.seen_under
    seen = replace(state, noise=noise, fit=fitted)
    points = Starts(problem, noise, fitted, state.columns, state.unstrained)
    trials = [
        refit(problem, seen, s, begin(problem, seen, s, points.of(s, windows)), settings, -np.inf, windows)
        for s, windows in passing
    ]
    return trials + _in_the_same_windows(problem, seen, trials, points, settings)


def _in_the_same_windows(
    problem: Problem, state: State, trials: Sequence[Trial], points: Starts, settings: Settings
) -> list[Trial]:
    """Rivals of the best effect that acts for a while: the likeliest others in its windows, under the noise left beside it."""
    brief = [t for t in trials if t.beside and t.gain > t.needed]
    if not brief:
        return []
    best = max(brief, key=lambda t: t.gain)
    windows = spell_of(problem.model.effect(best.effect), best.fit.values)
    assert windows is not None
    assert best.beside is not None
    tried = {t.effect for t in trials if t.beside}
    others = [c for c in state.columns if c.effect.size == 1 and c.effect.name not in tried]
    scores = screen(problem, best.beside.noise, best.beside.fit, within(problem, others, windows), settings)
    likely = [s for s in scores if s.statistic > best.needed][: settings.shortlist // 2]
    return [
        refit(problem, state, s, begin(problem, state, s, points.of(s, windows)), settings, -np.inf, windows)
        for s in likely
    ]


def begin(problem: Problem, state: State, found: Score, points: Sequence[tuple[Values, float]]) -> list[Fit]:
    """The first steps of a refit with one more effect from each of its starts, best first.

    Where they lead up though the screen is beyond doubt, they were led by sensitivities of elsewhere, and are taken again.
    """
    names = free_names(problem, (*state.accepted, found.effect))
    fits = [fit(problem, state.noise, names, point, iterations=2, rough=True) for point, _ in points]
    if all(f.sse > state.fit.sse for f in fits) and found.statistic * found.inflation > CLEAR:
        fits = [fit(problem, state.noise, names, points[0][0], iterations=6)]
    return sorted(fits, key=lambda f: f.sse)


def refit(
    problem: Problem,
    state: State,
    found: Score,
    begun: Sequence[Fit],
    settings: Settings,
    least: float,
    windows: range | None,
) -> Trial:
    """Non-linear refit with one more effect, brought to its end if its beginnings gained at least `least`; windows: as in `begin`."""
    effect, names, best = problem.model.effect(found.effect), begun[0].names, begun[0]
    if problem.model.costly:
        least = max(least, REACH * price(problem, effect, best.values, settings.alpha))
    if state.fit.sse - best.sse > least:
        fits: list[Fit] = []
        for b in begun:
            if not any(_one_place(problem, b, ended) for ended in fits):
                fits.append(fit(problem, state.noise, names, b.values, iterations=4))
        best = min(fits, key=lambda f: f.sse)
    if windows is None:
        trial = weighed(problem, state, effect, best, settings)
        if trial.gain <= trial.needed or trial.size >= problem.model.negligible:
            return trial
        # beside a nuisance that can do nearly the same, derivatives of a little elsewhere do not tell the way
        problem.forget_derivatives()
        return weighed(problem, state, effect, fit(problem, state.noise, names, best.values), settings)
    names = free_names(problem, state.accepted)
    own = settle(problem, state.noise, effect, names, best.values, windows, state.columns)
    alike = own.even(settings.alpha / len(problem.model.effects))
    beside = replace(state, noise=own.noise, fit=own.without)
    size = size_of(effect, own.with_it)
    needed = price(problem, effect, best.values, settings.alpha)
    gain = own.sure_gain if alike else 0.0  # what comes and goes in between is another thing
    return Trial(effect.name, own.with_it, gain, own.gain, needed, None, own.inflation, size, beside=beside)


def _one_place(problem: Problem, one: Fit, other: Fit) -> bool:
    """Whether two fits of the same parameters stand within a typical change of each other, and so lead to the same end."""
    apart = [one.values.shared[name] - other.values.shared[name] for name in one.names]
    typical = [problem.model.parameter(name).typical for name in one.names]
    return bool(np.max(np.abs(apart) / np.abs(typical)) < 1.0)


def weighed(problem: Problem, state: State, effect: Effect, fitted: Fit, settings: Settings) -> Trial:
    """What a fit with one effect more than the state's gains, and what it would have to."""
    plain, inflation = state.fit.sse - fitted.sse, spread(fitted, active(effect), stretches(state.noise))
    needed = price(problem, effect, fitted.values, settings.alpha)
    size = size_of(effect, fitted)
    return Trial(effect.name, fitted, plain / inflation, plain, needed, None, inflation, size)


def size_of(effect: Effect, fitted: Fit) -> float:
    """What the largest of an effect's switches surely is, in typical changes: all moved back together until 95 % would reach them."""
    own = switches(effect)
    away = np.array([fitted.values.shared[p.name] - p.value for p in own])
    at = [fitted.names.index(p.name) for p in own]
    sure = float(away @ inverse(fitted.covariance[np.ix_(at, at)]) @ away)
    left = max(1.0 - SURE / np.sqrt(sure), 0.0) if sure > 0.0 else 0.0
    return left * float(np.max(np.abs(away) / np.abs([p.typical for p in own])))


def confirm(
    problem: Problem, state: State, trial: Trial, settings: Settings, without: Array | None = None
) -> Trial:
    """The trial with its gain in SSE on held-out rows, summed over the folds: everything shared is fitted on the other rows.

    without: the state's own held-out residual, where it is known.
    """
    noise, count = state.noise, len(problem.channels)
    if without is None:
        enough = near(problem, trial.gain)
        without = held_out_residual(problem, noise, state.accepted, state.fit.values, settings, enough=enough)
    with_it = held_out_residual(problem, noise, (*state.accepted, trial.effect), trial.fit.values, settings)
    gained, whole = without**2 - with_it**2, np.bincount(noise.row_channel, without**2, count)
    taken = np.bincount(noise.row_channel, gained, count) / np.maximum(whole, 1e-300)
    return replace(trial, held_out_gain=float(np.sum(gained)), explained=float(np.max(taken)))


def held_out_residual(
    problem: Problem,
    noise: Noise,
    effects: Sequence[str],
    start: Values,
    settings: Settings,
    *,
    enough: float | None = None,
) -> Array:
    """Whitened residual (n,), every row from a fit of the shared parameters that has not seen it; enough: as in `fit`."""
    residual = np.empty(noise.keep.size)
    for test, judged in judged_elsewhere(problem, noise, effects, start, settings, enough=enough):
        residual[test] = judged.residual[test]
    return residual


def judged_elsewhere(
    problem: Problem,
    noise: Noise,
    effects: Sequence[str],
    start: Values,
    settings: Settings,
    *,
    enough: float | None = None,
) -> Iterator[tuple[Mask, Fit]]:
    """Rows held out in turn, with a fit in which shared parameters are those of the other rows; enough: as in `fit`."""
    names = free_names(problem, effects)
    for test in folds(problem, noise, settings.folds):
        trained = fit(problem, noise, names, start, rows=~test, iterations=4, rough=True, enough=enough)
        yield test, held_out(problem, noise, trained.values, test)


def near(problem: Problem, gain: float) -> float | None:
    """Gain in SSE that is not worth a step of a fit without an effect that gains so much; None where steps cost little."""
    return NEAR * gain if problem.model.costly else None


def folds(problem: Problem, noise: Noise, count: int) -> list[Mask]:
    """Rows held out in turn: every count-th window, or stretches of time where windows are few."""
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
