"""Effects so strong that the noise of the search hides them: each is judged under the noise that it leaves itself.

The search estimates the noise from what no effect of the library explains to first order. Of a strong effect that is not linear, first order
explains next to nothing: its misfit counts as noise, and beside so much noise no effect is seen.
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import Final

from discrepancy import gates
from discrepancy.estimation.effort import CACHED
from discrepancy.estimation.fit import Fit, fit, log_likelihood
from discrepancy.estimation.noise import Noise, estimate_noise, white_noise
from discrepancy.estimation.problem import Problem, Values
from discrepancy.model.description import Effect
from discrepancy.selection.assess import screen
from discrepancy.selection.candidate_fits import candidate_fit, confirm, finished, first_steps, shortlisted
from discrepancy.selection.screen import sensitivities
from discrepancy.selection.starts import Starts
from discrepancy.selection.state import CandidateFit, Settings, State, switched_off

TRIED: Final = 3  # effects that get a noise of their own: those with the largest reductions under white noise
PASSES: Final = 2  # alternations between fit and noise


def under_own_noise(problem: Problem, state: State, settings: Settings) -> list[CandidateFit]:
    """The best effect that passes under its own noise, where it also makes the recordings more likely; or nothing."""
    raw = problem.measured - problem.predict(state.fit.values)
    white = white_noise(problem, raw, state.noise.initial_uncertainty, state.aside.rows)
    base = fit(problem, white, state.fit.names, state.fit.values, effort=CACHED)
    candidates = [e for e in problem.model.effects if e.name not in state.accepted]
    columns = sensitivities(problem, base.values, problem.predict(base.values), candidates)
    scores = screen(problem, white, base, columns, settings)
    seen = replace(state, noise=white, fit=base)
    points = Starts(problem, white, base, columns, state.at_prior)
    trials = [
        finished(problem, seen, s, first_steps(problem, seen, s, points.of(s, None)), settings, 0.0)
        for s in shortlisted(problem.model.effects, scores, settings)
    ]
    # what is not strong is not hidden: it would have been seen in the search
    strong = [t for t in trials if t.fit.data_sse < (1.0 - gates.STRONG.threshold) * base.data_sse]
    trials = sorted((t for t in strong if t.margin > 0.0), key=lambda t: -t.margin)[:TRIED]
    if not trials:
        return []
    # the model without an effect gets the same chance, or a better fit of its own would count as the effect's
    settled = _settled(problem, white, base)
    known = max(log_likelihood(problem, state.noise, state.fit), log_likelihood(problem, *settled))
    starts = state.fit.values, settled[1].values
    good = list[tuple[float, CandidateFit]]()
    for trial in trials:
        effect, (noise, found) = problem.model.effect(trial.effect), _settled(problem, white, trial.fit)
        reference = replace(state, noise=noise, fit=_without(problem, state, effect, noise, found, starts))
        own = replace(candidate_fit(problem, reference, effect, found, settings), reference=reference)
        gained = log_likelihood(problem, noise, found) - known
        if own.passes and gained > own.threshold:
            own = confirm(problem, reference, own, settings)
            if own.accepted(settings) and not own.negligible(problem):
                good.append((gained - own.threshold, own))
    return [max(good, key=lambda g: g[0])[1]] if good else []


def _settled(problem: Problem, noise: Noise, fitted: Fit) -> tuple[Noise, Fit]:
    """A fit and the noise that it leaves, each estimated under the other."""
    for _ in range(PASSES):
        left = problem.measured - problem.predict(fitted.values)
        noise = estimate_noise(problem, left, len(fitted.names), noise)
        fitted = fit(problem, noise, fitted.names, fitted.values, effort=CACHED)
    return noise, fitted


def _without(
    problem: Problem, state: State, effect: Effect, noise: Noise, found: Fit, starts: Iterable[Values]
) -> Fit:
    """The best fit without the effect, under the noise that the effect leaves."""
    off = found.values.with_shared(switched_off(effect))
    fits = [fit(problem, noise, state.fit.names, at, effort=CACHED) for at in (*starts, off)]
    return min(fits, key=lambda f: f.sse)
