"""The parts of a result that only restate: parameters with intervals, the ranking, nuisances, noise."""

from collections.abc import Sequence
from functools import cache

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2, ncx2
from scipy.stats import t as student

from discrepancy import findings as f
from discrepancy.fit import Fit
from discrepancy.model import Effect, Parameter
from discrepancy.noise import Noise
from discrepancy.normal import inverse
from discrepancy.openended import OpenEnded
from discrepancy.problem import Problem
from discrepancy.quantities import quantity
from discrepancy.recording import Array
from discrepancy.screen import Score, active, changes_at, jackknife, least_seen, penalty, stretches, switches
from discrepancy.state import Settings, State, Trial
from discrepancy.visible import NEARLY, in_a_valley, left_by_refit

ENOUGH_POWER = 0.8
TWIN = 0.95  # share of an effect that the nuisances can do, from which no driving tells them apart
WHITE_LAGS = 20
ALONE = 0.9  # share of what is known of a parameter, beyond which the stretch that tells it is not asked to agree with the others


def estimate(parameter: Parameter, fitted: Fit, noise: Noise | None = None) -> f.Estimate:
    """Value and 95 % interval within the bounds, wider where scores are correlated over time or stretches disagree."""
    value, sd = fitted.values.shared[parameter.name], fitted.sd(parameter.name)
    reach = 1.96 * sd
    if noise is not None:
        blocks = stretches(noise)
        variance = jackknife(fitted, blocks, ALONE)[fitted.names.index(parameter.name)]
        if variance > 0.0:
            reach = max(reach, float(student.ppf(0.975, int(blocks.max())) * np.sqrt(variance)))
    close = 1e-3 * abs(parameter.typical)
    # the end of a sign or a time constant's zero is its meaning, not a wall
    at = "lower" if value - parameter.lower < close else "upper" if parameter.upper - value < close else None
    return f.Estimate(
        name=parameter.name,
        value=value,
        low=max(value - reach, parameter.lower),
        high=min(value + reach, parameter.upper),
        unit=parameter.unit,
        at_bound=at,
        baseline=None if parameter.shape else parameter.value,
    )


def candidates(
    problem: Problem, state: State, baseline: State, found: Sequence[f.Finding], settings: Settings
) -> list[f.Candidate]:
    """Every effect of the library with its score on the baseline and what became of it, likeliest first."""
    final = {s.effect: s for s in state.scores}
    small = _negligible(problem, (*baseline.trials, *state.trials))
    for_a_while = {s.effect for s, _ in baseline.passing}
    rows = []
    for score in baseline.scores:
        effect, last = problem.model.effect(score.effect), final.get(score.effect, score)
        freedom = len(active(effect))
        critical = penalty(freedom, len(problem.model.effects), settings.alpha)
        seen = _typical_seen(state, effect, last)
        told = _of_found(effect, found)
        if told is None and _power(critical, freedom, seen) >= ENOUGH_POWER and in_a_valley(effect, last):
            seen = min(seen, left_by_refit(problem, state, effect, last))
        power = _power(critical, freedom, seen)
        verdict, reason = (
            told
            or _blind(problem, effect, score, power)
            or (("negligible", small[effect.name]) if effect.name in small else None)
            or _refuted(score.statistic > critical or effect.name in for_a_while, bool(found))
        )
        rows.append(
            f.Candidate(
                effect=effect.name,
                kind=effect.kind,
                verdict=verdict,
                statistic=score.statistic,
                p_value=score.p_value,
                expected=_expected(effect, score),
                power=power,
                absorbed=score.absorbed,
                noticed_from=_noticed_from(effect, seen, critical, problem.model.negligible),
                reason=reason,
            )
        )
    return sorted(rows, key=lambda c: (c.p_value, -c.statistic))


def _power(critical: float, freedom: int, seen: float) -> float:
    """Chance that a noncentral chi-square exceeds what would count; none of what leaves no trace."""
    return float(ncx2.sf(critical, freedom, seen)) if seen > 0.0 else 0.0


Judged = tuple[f.Verdict, str]
"""A verdict on a candidate and its reason."""


def _of_found(effect: Effect, found: Sequence[f.Finding]) -> Judged | None:
    if effect.name in {x.effect for x in found}:
        return "found", "see findings"
    if effect.name in {m.effect for x in found for m in x.group}:
        return "confusable with a finding", "explains the recordings as well as a finding"
    return None


def _blind(problem: Problem, effect: Effect, score: Score, power: float) -> Judged | None:
    """Why nothing can be said of it; None where something can. power: at the end; score: of the baseline."""
    verdict: f.Verdict = "could not be judged"
    if score.power == 0.0:
        return verdict, _why_invisible(problem, effect)
    if power >= ENOUGH_POWER:
        return None
    if score.absorbed > TWIN or (score.absorbed > NEARLY and score.power >= ENOUGH_POWER):
        return verdict, "the baseline's own parameters can do the same; needs another channel"
    needs = effect.excited_by or "more data"
    return verdict, f"a typical one would hardly be noticed here; needs {needs}"


def _refuted(likely: bool, beside_findings: bool) -> Judged:
    """What is not needed, though it seemed `likely` by itself, or is ruled out."""
    if not likely:
        return "ruled out", "a typical one would have been noticed"
    if beside_findings:
        return "not needed", "what speaks for it is explained better by a finding"
    return (
        "not needed",
        "what speaks for it by itself does not stand up to a refit, or differs between stretches",
    )


def _negligible(problem: Problem, trials: Sequence[Trial]) -> dict[str, str]:
    """What was seen of effects that are significant and yet too small to matter."""
    least, told = problem.model.negligible, {}
    for t in [t for t in trials if t.gain > t.needed and t.negligible(problem)]:
        seen = [
            f"{p.name} = {quantity(t.fit.values.shared[p.name], p.unit)}"
            for p in switches(problem.model.effect(t.effect))
        ]
        why = (
            f"not surely above {least:.0%} of a change that matters"
            if t.size < least
            else "hardly helps any channel"
        )
        told[t.effect] = f"{why}: {', '.join(seen)}"
    return told


def _why_invisible(problem: Problem, effect: Effect) -> str:
    gone = [name for name in problem.missing if name in effect.place or name in effect.excited_by]
    if gone:
        return f"there is no usable {', '.join(gone)}"
    return f"leaves no trace beyond the nuisances in these recordings; needs {effect.excited_by or 'another channel'}"


def _expected(effect: Effect, score: Score) -> list[f.Estimate]:
    if score.power == 0.0:
        return []
    return [
        f.Estimate(name=p.name, value=float(p.value + c), low=None, high=None, unit=p.unit)
        for p, c in zip(switches(effect), score.change, strict=True)
    ]


def _typical_seen(state: State, effect: Effect, score: Score) -> float:
    """Noncentrality that its typical changes make of its chi-square: of one that was accepted by the final fit, else by the screen."""
    own = switches(effect)
    typical = np.array([p.typical for p in own])
    if effect.name in state.accepted:
        at = [state.fit.names.index(p.name) for p in own]
        information = inverse(state.fit.covariance[np.ix_(at, at)])
        return max(float(np.linalg.eigvalsh(typical[:, None] * information * typical)[0]), 0.0)
    if score.power == 0.0:
        return 0.0
    return least_seen(score.direction, typical / changes_at(effect, score.probe)) / score.inflation


def _noticed_from(effect: Effect, seen: float, critical: float, negligible: float) -> list[f.Estimate]:
    """Values of its switches from which on it would be noticed with ENOUGH_POWER, all the same share of their typical changes."""
    own = switches(effect)
    if seen == 0.0:
        return []
    share = max(float(np.sqrt(_noncentrality(len(own), critical) / seen)), negligible)
    if any(p.whole for p in own):  # is there or not
        share = 1.0 if share <= 1.0 else np.inf
    sizes = [p.value + share * p.typical for p in own]
    if any(not p.lower <= size <= p.upper for p, size in zip(own, sizes, strict=True)):
        return []
    return [
        f.Estimate(name=p.name, value=size, low=None, high=None, unit=p.unit, baseline=p.value)
        for p, size in zip(own, sizes, strict=True)
    ]


@cache
def _noncentrality(freedom: int, critical: float) -> float:
    """What brings a chi-square beyond `critical` with ENOUGH_POWER."""

    def lacking(x: float) -> float:
        return float(ncx2.sf(critical, freedom, x)) - ENOUGH_POWER

    return float(brentq(lacking, 1e-6, 4.0 * critical + 100.0))


def open_equation(beyond: OpenEnded) -> f.OpenEquation | None:
    """The open-ended result, if there is one."""
    if not beyond.terms:
        return None
    return f.OpenEquation(
        equation=beyond.equation(),
        depends_on=list(dict.fromkeys(n for t in beyond.terms for n in t.function.signals)),
        terms=[
            f.OpenTerm(
                place=t.place,
                function=t.function.text,
                coefficient=t.coefficient,
                low=t.coefficient - 1.96 * t.sd,
                high=t.coefficient + 1.96 * t.sd,
                unit=t.unit,
                equally_good=list(t.equally_good),
            )
            for t in beyond.terms
        ],
        gain=beyond.gain,
        needed=beyond.needed,
        held_out_gain=beyond.held_out_gain,
    )


def nuisances(problem: Problem, state: State) -> list[f.Nuisance]:
    """Baseline parameters before and after."""
    return [
        f.Nuisance(
            name=p.name,
            unit=p.unit,
            before=p.value,
            after=state.fit.values.shared[p.name],
            sd=state.fit.sd(p.name),
            prior_sd=p.prior_sd,
        )
        for p in problem.model.nuisances
        if p.scope == "all"
    ]


def channel_noise(problem: Problem, state: State) -> list[f.ChannelNoise]:
    """One-step errors at the end, and whether they are white."""
    spread = state.noise.innovation_sd(problem)
    orders = {name: state.noise.whiteners[b.group].order for b in problem.blocks for name in b.channels}
    return [
        f.ChannelNoise(
            channel=name,
            unit=problem.model.outputs[name],
            one_step_error=spread[name],
            order=orders[name],
            whiteness_p=whiteness(state.fit.residual[state.noise.row_channel == i], orders[name]),
        )
        for i, name in enumerate(problem.channels)
    ]


def whiteness(innovations: Array, order: int) -> float:
    """p-value of Ljung and Box (1978) over 20 lags; 1 when there are too few rows to ask."""
    n = innovations.size
    lags = min(WHITE_LAGS, n // 5)
    if lags <= order + 1:
        return 1.0
    e = innovations - np.mean(innovations)
    power = float(e @ e)
    q = sum((float(e[k:] @ e[:-k]) / power) ** 2 / (n - k) for k in range(1, lags + 1))
    return float(chi2.sf(n * (n + 2) * q, lags - order))
