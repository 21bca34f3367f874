"""Where a search stands with some effects accepted: noise, fit, and the scores of all others."""

from collections.abc import Sequence

import numpy as np

from discrepancy.fit import Fit, begins, fit
from discrepancy.model import Effect
from discrepancy.noise import Noise, estimate_noise, white_noise
from discrepancy.problem import Problem, Values
from discrepancy.screen import (
    Columns,
    Projector,
    Score,
    active,
    by_statistic,
    penalty,
    projected,
    score,
    sensitivities,
    stretches,
)
from discrepancy.spells import for_a_while, runs
from discrepancy.state import STRAINED, Settings, State, free_names
from discrepancy.unexplained import unexplained, unexplained_by_window

ROUGHLY = (
    1e-4  # gain in SSE per row that is not worth a step of a costly model while the noise is not known yet
)


def assess(problem: Problem, accepted: tuple[str, ...], values: Values, settings: Settings) -> State:
    """Noise with all candidates projected out, the fit under it, and the screen of what is not accepted."""
    names = free_names(problem, accepted)
    candidates = [e for e in problem.model.effects if e.name not in accepted]
    base = problem.predict(values)
    noise = white_noise(problem, problem.measured - base, begins(problem, values, base, rough=True))
    enough = ROUGHLY * noise.keep.size if problem.model.costly else None
    fitted = fit(problem, noise, names, values, rough=True, enough=enough)
    at = values if problem.model.costly else fitted.values
    for last in (False, True):
        home = _unstrained(problem, fitted)
        problem.settle(home or fitted.values)
        if home is not None and accepted:
            fitted = _from_home(problem, noise, fitted, home)
        base = problem.predict(fitted.values)
        columns = sensitivities(problem, at, problem.predict(at), candidates)
        raw = problem.measured - base
        left = unexplained(problem, noise, fitted, raw, columns)
        known = noise.having(problem, begins(problem, fitted.values, base, rough=not last))
        noise = estimate_noise(problem, *left, known)
        fitted = fit(problem, noise, names, fitted.values, enough=None if last else enough)
        at = fitted.values
    scores = screen(problem, noise, fitted, columns, settings)
    passing, seen_under = _for_a_while(problem, noise, fitted, columns, settings)
    unstrained = _unstrained(problem, fitted)
    if unstrained is not None:
        scores = _better(scores, _screen_at(problem, noise, names, unstrained, candidates, settings))
    return State(
        noise, fitted, accepted, tuple(scores), (), tuple(columns), tuple(passing), seen_under, unstrained
    )


def _for_a_while(
    problem: Problem, noise: Noise, fitted: Fit, columns: Sequence[Columns], settings: Settings
) -> tuple[list[tuple[Score, range]], tuple[Noise, Fit] | None]:
    """Effects that may act for a while only, and the noise and fit by which they are seen: noise from which candidates are projected out as

    they act always holds them.
    """
    if not runs(problem):
        return [], None
    raw = problem.measured - problem.predict(fitted.values)
    noise = estimate_noise(problem, *unexplained_by_window(problem, noise, fitted, raw, columns), noise)
    fitted = fit(problem, noise, fitted.names, fitted.values)
    scores = screen(problem, noise, fitted, columns, settings)
    return for_a_while(problem, noise, fitted, scores, columns, settings.alpha), (noise, fitted)


def _from_home(problem: Problem, noise: Noise, fitted: Fit, home: Values) -> Fit:
    """The fit, or a better one that begins with nuisances at their priors: what they stood in for is among the effects now."""
    here = fit(problem, noise, fitted.names, fitted.values, iterations=0, rough=True)
    other = fit(problem, noise, fitted.names, home)
    return min(here, other, key=lambda f: f.sse)


def _unstrained(problem: Problem, fitted: Fit) -> Values | None:
    """Nuisances back at their priors if one of them is far from its own: it may stand in for an effect that is seen from there only."""
    known = [p for p in problem.model.nuisances if p.scope == "all" and p.prior_sd is not None]
    shared = fitted.values.shared
    if all(abs(shared[p.name] - p.value) <= STRAINED * (p.prior_sd or np.inf) for p in known):
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
    point, base = fit(problem, noise, names, values, iterations=0), problem.predict(values)
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
    projector, blocks = Projector(problem, noise, fitted), stretches(noise)
    needed = [penalty(len(active(c.effect)), len(columns), settings.alpha) for c in columns]
    return by_statistic(
        [
            score(c, seen, fitted.residual, critical, blocks)
            for c, seen, critical in zip(columns, projected(noise, projector, columns), needed, strict=True)
        ]
    )
