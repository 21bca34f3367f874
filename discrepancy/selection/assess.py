"""One round of the search: with some effects accepted, estimates noise and parameters and scores all other effects."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from discrepancy import gates
from discrepancy.estimation.effort import AS_IT_IS, CACHED, FULL, Effort
from discrepancy.estimation.fit import Fit, fit, initial_uncertainty
from discrepancy.estimation.noise import Noise, estimate_noise, white_noise
from discrepancy.estimation.problem import Problem, Values, Windows
from discrepancy.estimation.set_aside import NOTHING, SetAside
from discrepancy.model.description import Effect
from discrepancy.selection.active_intervals import temporary_effects, window_ranges
from discrepancy.selection.riddles import wrong_readings
from discrepancy.selection.screen import (
    Columns,
    Projector,
    Score,
    by_statistic,
    penalty,
    projected,
    score,
    sensitivities,
    time_blocks_of,
)
from discrepancy.selection.state import Settings, State, free_names
from discrepancy.selection.unexplained import unexplained, unexplained_by_window
from discrepancy.signals.recording import Array

Left = tuple[Array, float]
"""What is unexplained (N,), and how many parameters were used to explain the rest."""
CLEARLY: Final = 1.0  # difference in SSE from which on another end of a fit is a better one, and not rounding


def assess(
    problem: Problem,
    accepted: tuple[str, ...],
    values: Values,
    settings: Settings,
    aside: SetAside = NOTHING,
    look: Callable[[Noise, Fit], None] | None = None,
) -> State:
    """Noise with all candidates projected out, the fit under it, and the screen of what is not accepted.

    aside: what nothing explains; the same in all of a search, because likelihoods of different rows cannot be compared. Of an expensive model the
    baseline's state says it. look: gets the first fit without that, under white noise, before any candidate is simulated.
    """
    names = free_names(problem, accepted)
    candidates = [e for e in problem.model.effects if e.name not in accepted]
    base = problem.predict(values)
    noise = white_noise(
        problem,
        problem.measured - base,
        initial_uncertainty(problem, values, base, cached=True),
        aside.rows,
    )
    least = problem.costs.rough_reduction(noise.keep.size)
    fitted = fit(problem, noise, names, values, effort=replace(CACHED, least_reduction=least))
    if not accepted and problem.costs.costly and not aside.rows and settings.set_aside != "nothing":
        aside = wrong_readings(problem, fitted)
        if aside.rows:
            noise = white_noise(
                problem,
                problem.measured - problem.predict(fitted.values),
                noise.initial_uncertainty,
                aside.rows,
            )
            fitted = fit(problem, noise, names, fitted.values, effort=replace(CACHED, least_reduction=least))
    if look is not None:
        look(noise, fitted)
    at = values if problem.costs.costly else fitted.values
    tried: list[tuple[Left, Noise]] = []
    # Noise and fit depend on each other. Two passes: the first under white noise, roughly, the second under the noise that it leaves.
    for last in (False, True):
        home = _at_prior(problem, fitted)
        fitted = replace(fitted, values=problem.warmed_up(fitted.values, home or fitted.values))
        at = at.warmed_up_as(fitted.values)
        if home is not None and accepted:
            fitted = from_prior(problem, noise, fitted, home.warmed_up_as(fitted.values))
        if accepted:
            fitted = from_guesses(problem, noise, fitted)
        # The noise is estimated from what no candidate explains. Otherwise a missing effect would count as noise, and hide itself.
        base = problem.predict(fitted.values)
        columns = sensitivities(problem, at, problem.predict(at), candidates)
        left = [unexplained(problem, noise, fitted, problem.measured - base, columns)]
        if not at.same(fitted.values) and problem.costs.costly:
            left.append(_left_at(problem, noise, fitted, at, columns))
        known = noise.having(problem, initial_uncertainty(problem, fitted.values, base, cached=not last))
        found = [(each, estimate_noise(problem, *each, known)) for each in left]
        tried = [*tried, *found] if problem.costs.costly else found
        noise = _likeliest(tried)
        effort = FULL if last else Effort(least_reduction=least)
        fitted = fit(problem, noise, names, fitted.values, effort=effort)
        if last and accepted:
            fitted = from_guesses(problem, noise, fitted)
            fitted = from_typical_shapes(problem, noise, fitted, accepted)
        at = fitted.values
    scores = screen(problem, noise, fitted, columns, settings)
    temporary, basis = _temporary_effects(problem, noise, fitted, columns, settings)
    at_prior = _at_prior(problem, fitted)
    if at_prior is not None:
        scores = _better(scores, _screen_at(problem, noise, names, at_prior, candidates, settings))
    return State(
        noise,
        fitted,
        accepted,
        tuple(scores),
        columns=tuple(columns),
        temporary=tuple(temporary),
        temporary_basis=basis,
        at_prior=at_prior,
        aside=aside,
    )


def _left_at(problem: Problem, noise: Noise, fitted: Fit, at: Values, columns: Sequence[Columns]) -> Left:
    """What is unexplained at the point where an expensive model's columns were taken, which need not be that of the fit.

    Without a pile that is there the simulated machine overturns, at each point in another way: columns of one say nothing about another.
    """
    point = fit(problem, noise, fitted.names, at, effort=replace(AS_IT_IS, cached=True))
    return unexplained(problem, noise, point, problem.measured - problem.predict(at), columns)


def _likeliest(tried: Sequence[tuple[Left, Noise]]) -> Noise:
    """Of noises, each estimated from what is unexplained at some point, the one under which its own rows are likeliest."""

    def likelihood(of: tuple[Left, Noise]) -> float:
        (rows, _), noise = of
        return 2.0 * noise.log_density() - float(np.sum(noise.whiten(rows) ** 2))

    return tried[0][1] if len(tried) == 1 else max(tried, key=likelihood)[1]


def _temporary_effects(
    problem: Problem, noise: Noise, fitted: Fit, columns: Sequence[Columns], settings: Settings
) -> tuple[list[tuple[Score, Windows]], tuple[Noise, Fit] | None]:
    """Effects that may act in one interval only, and the noise and fit under which they were scored."""
    # The noise of `assess` has candidates projected out that act throughout. It still contains an effect that acts in one interval, so
    # here the candidates are projected out window by window. It is done under white noise: a noise that has taken what begins half-way
    # for a long memory of its own sees nothing else in it any more.
    if not window_ranges(problem):
        return [], None
    raw = problem.measured - problem.predict(fitted.values)
    white = white_noise(problem, raw, noise.initial_uncertainty, noise.set_aside)
    plain = fit(problem, white, fitted.names, fitted.values)
    raw = problem.measured - problem.predict(plain.values)
    noise = estimate_noise(problem, *unexplained_by_window(problem, white, plain, raw, columns), white)
    fitted = fit(problem, noise, fitted.names, fitted.values)
    scores = screen(problem, noise, fitted, columns, settings)
    return temporary_effects(problem, noise, fitted, scores, columns, settings.alpha), (noise, fitted)


def from_prior(problem: Problem, noise: Noise, fitted: Fit, at_prior: Values) -> Fit:
    """The fit, or a better one that starts with nuisances at their priors: the effect that they imitated is now in the model."""
    here = fit(problem, noise, fitted.names, fitted.values, effort=replace(AS_IT_IS, cached=True))
    other = fit(problem, noise, fitted.names, at_prior)
    return min(here, other, key=lambda f: f.sse)


def from_guesses(problem: Problem, noise: Noise, fitted: Fit) -> Fit:
    """The fit, or a better one that begins with all initial states as the model guesses them: they imitated the effect before it was accepted."""
    if not problem.local_names:
        return fitted
    other = fit(problem, noise, fitted.names, fitted.values.starting_as(problem.guesses))
    return other if other.sse < fitted.sse - CLEARLY else fitted


def from_typical_shapes(problem: Problem, noise: Noise, fitted: Fit, accepted: Sequence[str]) -> Fit:
    """The fit, or a better one that begins with the shapes of accepted effects where these were scored.

    The place of a pile has a minimum wherever its force would set in beside something else. The noise has changed since the fit chose among them.
    """
    shapes = [p for name in accepted for p in problem.model.effect(name).parameters if p.shape]
    begin = {p.name: p.value + p.typical for p in shapes if p.name in fitted.names}
    typical = {p.name: abs(p.typical) for p in shapes}
    shared = fitted.values.shared
    if all(abs(shared[name] - value) <= typical[name] for name, value in begin.items()):
        return fitted
    start = fitted.values.with_shared(begin)
    other = fit(problem, noise, fitted.names, problem.warmed_up(start, start))
    if other.sse >= fitted.sse - CLEARLY:
        return fitted
    # at a wrong place the size has gone to nothing, and beside a size of nothing the shape has no slope: now it has
    return fit(problem, noise, fitted.names, other.values)


def _at_prior(problem: Problem, fitted: Fit) -> Values | None:
    """The values with nuisances at their priors, if one of them is in conflict with its prior; else None.

    Such a nuisance may imitate a missing effect, which then shows only where the nuisance is back at its prior.
    """
    known = [p for p in problem.model.nuisances if p.scope == "all" and p.prior_sd is not None]
    shared, most = fitted.values.shared, gates.PRIOR_CONFLICT.threshold
    if all(abs(shared[p.name] - p.value) <= most * (p.prior_sd or float("inf")) for p in known):
        return None
    return fitted.values.with_shared({p.name: p.value for p in known})


def _screen_at(
    problem: Problem,
    noise: Noise,
    names: Sequence[str],
    values: Values,
    candidates: Sequence[Effect],
    settings: Settings,
) -> list[Score]:
    """Scores at other values than those of the fit, under the same noise."""
    point, base = fit(problem, noise, names, values, effort=AS_IT_IS), problem.predict(values)
    columns = sensitivities(problem, values, base, candidates)
    return screen(problem, noise, point, columns, settings)


def _better(one: Sequence[Score], other: Sequence[Score]) -> list[Score]:
    """Each effect's higher score, best first."""
    by_name = {s.effect: s for s in other}
    return by_statistic([max(s, by_name[s.effect], key=lambda x: x.statistic) for s in one])


def screen(
    problem: Problem, noise: Noise, fitted: Fit, columns: Sequence[Columns], settings: Settings
) -> list[Score]:
    """Scores of all candidates, best first."""
    projector, blocks = Projector(problem, noise, fitted), time_blocks_of(noise)
    needed = [penalty(len(c.effect.amplitude_names), len(columns), settings.alpha) for c in columns]
    return by_statistic(
        [
            score(c, seen, fitted.residual, critical, blocks)
            for c, seen, critical in zip(columns, projected(noise, projector, columns), needed, strict=True)
        ]
    )
