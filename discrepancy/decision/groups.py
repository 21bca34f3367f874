"""Groups of effects that these recordings cannot distinguish, and the manoeuvre that would distinguish them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from discrepancy import gates
from discrepancy.decision.prospect import Prospect, manoeuvre_recording
from discrepancy.estimation.effort import BRIEF, Effort
from discrepancy.estimation.fit import Fit, fit
from discrepancy.estimation.noise import Noise
from discrepancy.estimation.problem import Problem, Unusable
from discrepancy.model.description import Effect, Manoeuvre, Parameter
from discrepancy.selection.active_intervals import active_interval_of, sse_threshold
from discrepancy.selection.candidate_fits import project_out, size_of
from discrepancy.selection.screen import Score, collinearity, time_blocks_of
from discrepancy.selection.starts import Starts
from discrepancy.selection.state import Progress, Settings, State, free_names, switched_off
from discrepancy.signals import findings as f
from discrepancy.signals.recording import Array

RIVAL: Effort = Effort(iterations=6)  # of a rival's fit
# A rival that comes near is fitted until it converges. Ruled out half-way, it would be ruled out by that alone: brakes that drag, after six
# steps, for a rolling resistance.
NEAR = 0.1  # of the finding's reduction in SSE, by which a rival may lack
TO_THE_END: Effort = Effort(iterations=14)
EXTRA_PARAMETER = 2.0  # reduction of the SSE that each further parameter must bring (AIC)


@dataclass(frozen=True, slots=True)
class Alternative:
    """An effect that explains the recording as well as a finding, with its fit in the finding's place."""

    effect: str
    difference: float  # in SSE, from the finding
    collinearity: float  # with the finding
    fit: Fit


def alternatives(
    problem: Problem,
    state: State,
    effect: str,
    without: Fit,
    scores: Sequence[Score],
    starts: Starts,
    settings: Settings,
    progress: Progress = lambda _: None,
) -> list[Alternative]:
    """Effects that explain the recordings as well as `effect` does in its place, best first; the best one may be another than `effect`.

    without: the fit without it; scores, starts: of the library beside that fit.
    """
    # Rivals are compared by likelihood, each fitted in the finding's place, and not by the collinearity of their sensitivities: beside a
    # nuisance that nearly imitates both, the projection leaves only rounding and noise even of two identical effects.
    others = tuple(name for name in state.accepted if name != effect)
    whole = without.sse - state.fit.sse
    own = _direction(problem, state.fit, effect)
    found = [Alternative(effect, 0.0, 1.0, state.fit)]
    interval = active_interval_of(problem.model.effect(effect), state.fit.values)
    rivals = [s for s in scores if s.effect not in state.accepted]
    rivals = [s for s in rivals if _worth_fitting(problem, effect, s, whole, settings)]
    for number, score in enumerate(rivals, 1):
        candidate = problem.model.effect(score.effect)
        if candidate.is_profile and not problem.model.effect(effect).is_profile:
            continue  # a curve contains such laws as special cases, and stands back behind them (ADR 76)
        if problem.costs.costly:  # else there are many, and each takes no time worth a line
            progress(f"trying {candidate.name} in place of {effect}, {number} of {len(rivals)}")
        names = free_names(problem, (*others, candidate.name))
        points = [start.values for start in starts.of(score, interval)]
        fits = [fit(problem, state.noise, names, point, effort=RIVAL) for point in points]
        best = min(fits, key=lambda f: f.sse)
        if size_of(candidate, best) < problem.model.negligible:
            continue  # nuisances explain the difference without it
        if any(in_between(p, best) for p in candidate.amplitude_parameters):
            continue  # half a wrong sign is a scale error and must not be named a wrong sign
        extra = EXTRA_PARAMETER * (candidate.size - problem.model.effect(effect).size)
        if settings.rival <= best.sse - state.fit.sse + extra < NEAR * whole:
            best = fit(problem, state.noise, names, best.values, effort=TO_THE_END)
        difference = best.sse - state.fit.sse + extra
        # one that fits as well is a rival whatever both do together: a second lag in series with the first explains more, and which is there stays open
        as_well = difference < settings.rival
        if fits_as_well(state.noise, without, state.fit, best, extra, settings) and (
            as_well or not _both_needed(problem, state, effect, candidate, best, settings)
        ):
            cosine = collinearity(own, _direction(problem, best, candidate.name))
            found.append(Alternative(candidate.name, float(difference), cosine, best))
    return _special_before_general(problem, sorted(found, key=lambda m: m.difference))


def fits_as_well(
    noise: Noise, without: Fit, fitted: Fit, other: Fit, extra: float, settings: Settings
) -> bool:
    """Whether another fit in a finding's place explains as much, beyond what the difference scatters over time; extra: what its further parameters must bring."""
    limit = max(settings.rival, gates.VUONG.threshold * difference_sd(noise, other, fitted))
    kept = without.sse - other.sse > gates.RIVAL_KEEPS.threshold * (without.sse - fitted.sse)
    return kept and other.sse - fitted.sse + extra < limit


def _special_before_general(problem: Problem, ranked: list[Alternative]) -> list[Alternative]:
    """The alternatives, best first, without curves where a law of few parameters is among them: it fits as well and says more."""
    return [a for a in ranked if not problem.model.effect(a.effect).is_profile] or ranked


def _worth_fitting(problem: Problem, effect: str, score: Score, whole: float, settings: Settings) -> bool:
    """Whether a rival is fitted: always if simulations are cheap; else if its score is high, or the library declares it confusable."""
    if not problem.costs.costly:
        return True
    finding, rival = problem.model.effect(effect), problem.model.effect(score.effect)
    declared = rival.name in finding.confusable or effect in rival.confusable
    return declared or score.raw_statistic >= gates.RIVAL_SCORE.threshold * whole - settings.same


def _both_needed(
    problem: Problem, state: State, effect: str, rival: Effect, fitted: Fit, settings: Settings
) -> bool:
    """Whether two rivals together explain more than the better one, beyond chance: then both may be present. fitted: the rival alone."""
    names = free_names(problem, (*state.accepted, rival.name))
    finding = problem.model.effect(effect)
    # start from either alone: where the other has no gradient at zero (a friction, a lag), one of the two fits does not move
    points = (
        state.fit.values.with_shared(switched_off(rival)),
        fitted.values.with_shared(switched_off(finding)),
    )
    together = min(fit(problem, state.noise, names, point, effort=BRIEF).sse for point in points)
    added = min(state.fit.sse, fitted.sse) - together
    least = sse_threshold(
        problem, max(finding, rival, key=lambda e: e.size), state.fit.values, settings.alpha
    )
    return added > gates.BOTH_NEEDED.threshold * least


def in_between(parameter: Parameter, fitted: Fit) -> bool:
    """Whether a discrete parameter fits best between its two values."""
    value = fitted.values.shared[parameter.name]
    apart = abs(value - parameter.value - parameter.typical)
    return parameter.discrete and apart > gates.DISCRETE_VALUE.threshold * abs(parameter.typical)


def difference_sd(noise: Noise, one: Fit, other: Fit) -> float:
    """Standard deviation of the difference in SSE of two fits, from its spread over blocks of time (Vuong 1989)."""
    # Two models that are both slightly wrong are better in turn; the likelihood alone would take the difference as certain.
    blocks = time_blocks_of(noise)
    per_block = np.bincount(blocks, one.residual**2 - other.residual**2)
    return float(np.std(per_block) * np.sqrt(per_block.size)) if per_block.size > 5 else 0.0


def _direction(problem: Problem, fitted: Fit, effect: str) -> Array:
    kept = [fitted.names.index(name) for name in problem.model.effect(effect).amplitude_names]
    return project_out(fitted, kept)


def separation(problem: Problem, noise: Noise, one: Alternative, other: Alternative) -> f.Separation | None:
    """The manoeuvre of the model in which two fitted explanations disagree most; else the sentence of the library, or None."""
    found = [
        f.Separation(
            effect=other.effect,
            manoeuvre=m.sentence,
            expected_difference=_expected(problem, noise, m, one, other),
        )
        for m in problem.model.manoeuvres
    ]
    best = max(found, key=lambda s: s.expected_difference or 0.0, default=None)
    if best is not None and (best.expected_difference or 0.0) > gates.MANOEUVRE_DECIDES.threshold:
        return best
    model = problem.model
    known = {**model.effect(other.effect).confusable, **model.effect(one.effect).confusable}
    text = known.get(other.effect, known.get(one.effect))
    return f.Separation(effect=other.effect, manoeuvre=text, expected_difference=None) if text else None


def _expected(
    problem: Problem, noise: Noise, manoeuvre: Manoeuvre, one: Alternative, other: Alternative
) -> float:
    """The expected difference in SSE between two explanations in a manoeuvre; 0 where it cannot be simulated."""
    recording = manoeuvre_recording(problem, manoeuvre)
    try:
        prospect = Prospect(problem, noise, recording, initial=manoeuvre.initial)
        return prospect.difference(one.fit, other.fit)
    except Unusable:
        return 0.0
