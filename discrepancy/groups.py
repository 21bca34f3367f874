"""Effects that this recording cannot tell apart, and the manoeuvre that would."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from discrepancy.fit import Fit, fit
from discrepancy.model import Manoeuvre, Model
from discrepancy.noise import Noise, Whitener, by_group
from discrepancy.problem import Problem, Unusable, Values
from discrepancy.recording import Recording, Signal
from discrepancy.screen import Score, active, collinearity, stretches, switches
from discrepancy.spells import spell_of
from discrepancy.starts import starts
from discrepancy.state import Settings, State, free_names
from discrepancy.trials import project_out, size_of

ENOUGH = 20.0  # expected likelihood difference (in SSE) of a manoeuvre worth proposing
ALIKE = 0.6  # cosine of sensitivities below which two effects are two effects, not one with two names
LIKELY = 0.3  # the same of the screen's probe, from which a fit may still turn out alike
UNSURE = 2.0  # standard deviations of a likelihood difference that do not decide


@dataclass(frozen=True, slots=True)
class Member:
    """An effect that explains the recording as well: difference in SSE from the best, and collinearity with it."""

    effect: str
    difference: float
    collinearity: float
    fit: Fit


@dataclass(frozen=True, slots=True)
class Separation:
    """A manoeuvre and the likelihood difference it would make between two explanations."""

    manoeuvre: str
    sentence: str
    difference: float


def members(
    problem: Problem, state: State, effect: str, without: Fit, scores: Sequence[Score], settings: Settings
) -> list[Member]:
    """Alternatives that do as well as `effect` in its place; the first is the best and may not be `effect`."""
    others = tuple(name for name in state.accepted if name != effect)
    whole = without.sse - state.fit.sse
    own = _direction(problem, state.fit, effect)
    found = [Member(effect, 0.0, 1.0, state.fit)]
    spell = spell_of(problem.model.effect(effect), state.fit.values)
    for score in scores:
        if score.effect in state.accepted or score.statistic < 0.25 * whole - settings.same:
            continue
        if collinearity(own, score.direction) < LIKELY:
            continue  # a fit costs tens of simulations, its direction none
        candidate = problem.model.effect(score.effect)
        names = free_names(problem, (*others, candidate.name))
        points = starts(without.values, candidate, score)
        if spell is not None:
            points = [point.acting(switches(candidate), spell) for point in points]
        fits = [fit(problem, state.noise, names, point, iterations=6) for point in points]
        best = min(fits, key=lambda f: f.sse)
        if size_of(candidate, best) < problem.model.negligible:
            continue  # nuisances do its work
        # a further parameter has to earn its keep
        extra = candidate.size - problem.model.effect(effect).size
        difference = best.sse - state.fit.sse + 2.0 * extra
        limit = max(settings.same, UNSURE * doubt(state.noise, best, state.fit))
        cosine = collinearity(own, _direction(problem, best, candidate.name))
        if difference < limit and cosine > ALIKE and without.sse - best.sse > 0.5 * whole:
            found.append(Member(candidate.name, float(difference), cosine, best))
    return sorted(found, key=lambda m: m.difference)


def doubt(noise: Noise, one: Fit, other: Fit) -> float:
    """Standard deviation of the difference in SSE of two rival fits, from its spread over stretches of time.

    After Vuong (1989): rivals that are both a little wrong take turns in being better.
    """
    blocks = stretches(noise)
    per_block = np.bincount(blocks, one.residual**2 - other.residual**2)
    return float(np.std(per_block) * np.sqrt(per_block.size)) if per_block.size > 5 else 0.0


def _direction(problem: Problem, fitted: Fit, effect: str) -> np.ndarray:
    kept = [fitted.names.index(name) for name in active(problem.model.effect(effect))]
    return project_out(fitted, kept)


def separating(problem: Problem, noise: Noise, one: Member, other: Member) -> Separation | None:
    """The model's manoeuvre for which two explanations, each as fitted, disagree most beyond the nuisances."""
    found = [
        Separation(m.name, m.sentence, disagreement(problem, noise, m, one, other))
        for m in problem.model.manoeuvres
    ]
    return max(found, key=lambda s: s.difference, default=None)


def disagreement(problem: Problem, noise: Noise, manoeuvre: Manoeuvre, one: Member, other: Member) -> float:
    """SSE left when `other` is fitted to what `one` predicts for the manoeuvre; both ways, the smaller."""
    try:
        return min(_left_over(problem, noise, manoeuvre, a, b) for a, b in ((one, other), (other, one)))
    except Unusable:
        return 0.0


def _left_over(problem: Problem, noise: Noise, manoeuvre: Manoeuvre, true: Member, assumed: Member) -> float:
    model = replace(problem.model, window_s=None)
    staged = Problem(model, [_staged(problem, manoeuvre)])
    values = Values(true.fit.values.shared, {n: np.array([v]) for n, v in _initial(model, manoeuvre).items()})
    staged.measured = staged.predict(values)
    spread = noise.innovation_sd(problem)
    whiteners = [
        Whitener(
            np.zeros((0, len(b[0].channels), len(b[0].channels))),
            np.diag([1.0 / spread[c] for c in b[0].channels]),
        )
        for b in by_group(staged.blocks)
    ]
    flat = Noise(staged, whiteners)
    start = Values(assumed.fit.values.shared, values.local)
    names = [n for n in assumed.fit.names if model.parameter(n) in model.nuisances]
    # the effect keeps its fitted value: that is what the recording at hand has taught
    return fit(staged, flat, names, start, iterations=4).sse


def _initial(model: Model, manoeuvre: Manoeuvre) -> dict[str, float]:
    return {p.name: manoeuvre.initial.get(p.name, p.value) for p in model.nuisances if p.scope == "window"}


def _staged(problem: Problem, manoeuvre: Manoeuvre) -> Recording:
    """Stamps as dense as those recorded; output values are placeholders until simulated."""
    signals: dict[str, Signal] = dict(manoeuvre.inputs)
    for block in problem.blocks:
        step = float(np.median(np.diff(block.time_s)))
        stamps = np.arange(0.0, manoeuvre.duration_s, step)
        for name in block.channels:
            signals.setdefault(name, Signal(stamps, stamps.copy(), problem.model.outputs[name]))
    return Recording(manoeuvre.name, signals, problem.windows[0].constants)
