"""Parts of the findings that come from a finished search: estimates with intervals, ranking of the library, nuisances, noise."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Final

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2, ncx2
from scipy.stats import t as student

from discrepancy import gates
from discrepancy.decision.sizes import flat
from discrepancy.decision.sizes.detectability import in_a_valley, left_by_refit
from discrepancy.estimation.fit import Fit
from discrepancy.estimation.noise import Noise
from discrepancy.estimation.normal_equations import inverse
from discrepancy.estimation.problem import Problem, Values
from discrepancy.model.description import Effect, Parameter
from discrepancy.selection.open_ended import OpenEnded
from discrepancy.selection.screen import (
    Score,
    changes_at,
    jackknife,
    least_seen,
    penalty,
    time_blocks_of,
)
from discrepancy.selection.state import CandidateFit, Settings, State
from discrepancy.signals import findings as f
from discrepancy.signals.quantities import quantity
from discrepancy.signals.recording import Array

POWER: Final = gates.POWER.threshold
SHEET_ALLOWS: Final = 1.96  # standard deviations of a prior to either side: its 95 %
WHITE_LAGS = 20  # lags of the test for whiteness
# An effect may act in a single block (a kerb). Without that block there is no estimate, so the jackknife removes at most this share of
# the information on a parameter.
ALONE = 0.9


def estimates(problem: Problem, effect: Effect, fitted: Fit, noise: Noise) -> list[f.Estimate]:
    """All parameters of an effect with their intervals."""
    return [estimated(problem, p, fitted, noise) for p in effect.parameters]


def estimated(problem: Problem, parameter: Parameter, fitted: Fit, noise: Noise) -> f.Estimate:
    """As `estimate`; the interval of a parameter whose small changes do nothing is that of the likelihood."""
    linear = estimate(parameter, fitted, noise)
    if not flat.is_flat(parameter, fitted):
        return linear
    low, high = flat.interval(problem, noise, fitted, parameter)
    return replace(linear, low=low, high=high)


def estimate(parameter: Parameter, fitted: Fit, noise: Noise | None = None) -> f.Estimate:
    """Value and 95 % interval within the bounds. With noise, the interval is at least that of the jackknife over blocks of time."""
    value, sd = fitted.values.shared[parameter.name], fitted.sd(parameter.name)
    reach = 1.96 * sd
    if noise is not None:
        blocks = time_blocks_of(noise)
        variance = jackknife(fitted, blocks, ALONE)[fitted.names.index(parameter.name)]
        if variance > 0.0:
            # Student: the variance is itself estimated from a few blocks. The larger of both, as few blocks may agree by chance.
            reach = max(reach, float(student.ppf(0.975, int(blocks.max())) * np.sqrt(variance)))
    typical = abs(parameter.typical)
    # of what the recordings do not determine, a standard deviation is no distance
    close = max(gates.AT_BOUND.threshold * typical, gates.AT_BOUND_SD.threshold * min(sd, typical))
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
    """Every effect of the library with its score on the baseline and its verdict, likeliest first."""
    final = {s.effect: s for s in state.scores}
    small = _negligible(problem, (*baseline.trials, *state.trials))
    temporary = {s.effect for s, _ in baseline.temporary}
    disagree = {
        t.effect for t in state.trials if t.raw_sse_reduction > gates.CLEAR.threshold and not t.passes
    }
    rows = []
    for score in baseline.scores:
        effect, last = problem.model.effect(score.effect), final.get(score.effect, score)
        freedom = len(effect.amplitude_names)
        critical = penalty(freedom, len(problem.model.effects), settings.alpha)
        seen = _typical_seen(state, effect, last)
        known = _of_found(effect, found)
        if known is None and _power(critical, freedom, seen) >= POWER and in_a_valley(effect, last):
            seen = min(seen, left_by_refit(problem, state, effect, last))
        power = _power(critical, freedom, seen)
        verdict, reason = (
            known
            or _undetectable(problem, effect, score, power)
            or (("negligible", small[effect.name]) if effect.name in small else None)
            or (DISAGREE if effect.name in disagree else None)
            or _refuted(score.statistic > critical or effect.name in temporary, bool(found))
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
                confounded_share=score.confounded_share,
                smallest_detectable=_smallest_detectable(effect, seen, critical, problem.model.negligible),
                reason=reason,
            )
        )
    return sorted(rows, key=lambda c: (c.p_value, -c.statistic))


def beside_values(candidates: Sequence[f.Candidate], values: Sequence[f.BaselineValue]) -> list[f.Candidate]:
    """The candidates; one that may act in place of a value of the baseline is neither ruled out nor needless."""
    found = []
    for c in candidates:
        instead = [v.estimate.name for v in values if c.effect in v.or_effects]
        if instead and c.verdict not in ("found", "confusable with a finding"):
            names = ", ".join(instead)
            reason = f"these recordings cannot distinguish it from another {names}; needs {names} measured by itself"
            c = replace(c, verdict="could not be judged", reason=reason)
        found.append(c)
    return found


def _power(critical: float, freedom: int, seen: float) -> float:
    """Probability that a noncentral chi-square exceeds the threshold; 0 for an effect without any trace."""
    return float(ncx2.sf(critical, freedom, seen)) if seen > 0.0 else 0.0


Judged = tuple[f.Verdict, str]
"""A verdict on a candidate and its reason."""

DISAGREE: Final[Judged] = (
    "could not be judged",
    "it would improve the prediction, but blocks of time disagree on its size: something else is missing beside it",
)


def _of_found(effect: Effect, found: Sequence[f.Finding]) -> Judged | None:
    if effect.name in {x.effect for x in found}:
        return "found", "see findings"
    if effect.name in {m.effect for x in found for m in x.group}:
        return "confusable with a finding", "explains the recordings as well as a finding"
    return None


def _undetectable(problem: Problem, effect: Effect, score: Score, power: float) -> Judged | None:
    """Verdict and reason of an effect that could not be judged, else None. power: in the final state; score: on the baseline."""
    verdict: f.Verdict = "could not be judged"
    # The reasons must keep the form "REASON; needs MANOEUVRE": diagnosis.advice collects the manoeuvres.
    if score.power == 0.0:
        return verdict, _why_invisible(problem, effect)
    if power >= POWER:
        return None
    half = score.confounded_share > gates.CONFOUNDED.threshold and score.power >= POWER
    if score.confounded_share > gates.COLLINEAR_NUISANCE.threshold or half:
        return (
            verdict,
            "other values of the baseline's own parameters have the same effect; needs another channel",
        )
    needs = effect.excited_by or "more data"
    return verdict, f"these recordings would hardly show a typical size; needs {needs}"


def _refuted(likely: bool, beside_findings: bool) -> Judged:
    """Verdict and reason of an effect that is not needed although it was `likely` alone, or that is ruled out."""
    if not likely:
        return "ruled out", "one of typical size would have been found"
    if beside_findings:
        return "not needed", "a finding explains its evidence better"
    return (
        "not needed",
        "a refit does not confirm its evidence, or blocks of time disagree on its size",
    )


def _negligible(problem: Problem, trials: Sequence[CandidateFit]) -> dict[str, str]:
    """Reasons, with sizes, of effects that are significant but too small to matter; by effect."""
    least, found = problem.model.negligible, {}
    for t in [t for t in trials if t.passes and t.negligible(problem)]:
        seen = [
            f"{p.name} = {quantity(t.fit.values.shared[p.name], p.unit)}"
            for p in problem.model.effect(t.effect).amplitude_parameters
        ]
        why = (
            f"not certainly above {least:.0%} of a change that matters"
            if t.size < least
            else "improves no channel noticeably"
        )
        found[t.effect] = f"{why}: {', '.join(seen)}"
    return found


def _why_invisible(problem: Problem, effect: Effect) -> str:
    gone = [name for name in problem.missing if name in effect.place or name in effect.excited_by]
    if gone:
        return f"there is no usable {', '.join(gone)}"
    return (
        f"in these recordings nuisances imitate it completely; needs {effect.excited_by or 'another channel'}"
    )


def _expected(effect: Effect, score: Score) -> list[f.Estimate]:
    if score.power == 0.0:
        return []
    return [
        f.Estimate(name=p.name, value=float(p.value + c), low=None, high=None, unit=p.unit)
        for p, c in zip(effect.amplitude_parameters, score.change, strict=True)
    ]


def _typical_seen(state: State, effect: Effect, score: Score) -> float:
    """Noncentrality of typical changes: from the final fit for an accepted effect, else from the screen."""
    own = effect.amplitude_parameters
    typical = np.array([p.typical for p in own])
    if effect.name in state.accepted:
        at = [state.fit.names.index(p.name) for p in own]
        information = inverse(state.fit.covariance[np.ix_(at, at)])
        return max(float(np.linalg.eigvalsh(typical[:, None] * information * typical)[0]), 0.0)
    if score.power == 0.0:
        return 0.0
    return (
        least_seen(score.direction, typical / changes_at(effect, score.trial_step)) / score.variance_inflation
    )


def _smallest_detectable(effect: Effect, seen: float, critical: float, negligible: float) -> list[f.Estimate]:
    """Smallest values of the amplitude parameters that would be found with probability POWER; empty if no possible size would.

    All parameters have the same share of their typical changes.
    """
    # the noncentrality grows with the square of the size
    own = effect.amplitude_parameters
    if seen == 0.0:
        return []
    share = max(float(np.sqrt(_noncentrality(len(own), critical) / seen)), negligible)
    if any(p.discrete for p in own):  # a sign cannot be partly wrong
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
    """Noncentrality with which a chi-square exceeds `critical` with probability POWER."""

    def lacking(x: float) -> float:
        return float(ncx2.sf(critical, freedom, x)) - POWER

    return float(brentq(lacking, 1e-6, 4.0 * critical + 100.0))


def open_equation(found: OpenEnded) -> f.OpenEquation | None:
    """The open-ended result, if there is one."""
    if not found.terms:
        return None
    return f.OpenEquation(
        equation=found.equation(),
        depends_on=list(dict.fromkeys(n for t in found.terms for n in t.function.signals)),
        terms=[t.reported for t in found.terms],
        sse_reduction=found.sse_reduction,
        threshold=found.threshold,
        held_out_sse_reduction=found.held_out_sse_reduction,
    )


def nuisances(problem: Problem, state: State) -> list[f.Nuisance]:
    """Baseline parameters before and after the fit."""
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


def baseline_values(problem: Problem, state: State, *, adequate: bool) -> list[f.BaselineValue]:
    """Nuisances in conflict with their priors, furthest first; adequate: whether all errors are within their budgets.

    In a model that is still wrong, a nuisance stands in for what is missing, and its value is not the machine's.
    """
    found = []
    most = gates.PRIOR_CONFLICT.threshold
    for p in [p for p in problem.model.nuisances if p.scope == "all" and p.prior_sd is not None]:
        e, sd = estimate(p, state.fit), p.prior_sd or 1.0
        away = abs(e.value - p.value) / sd
        if away > most or e.at_bound is not None:
            e = estimate(p, state.fit, state.noise)  # the interval of the jackknife costs more
            found.append(
                f.BaselineValue(
                    estimate=e,
                    prior_sd=sd,
                    away=away,
                    sure=adequate and beyond_prior(p, e) and away > most and e.at_bound is None,
                )
            )
    return sorted(found, key=lambda b: -b.away)


def sure_values(problem: Problem, state: State, *, adequate: bool) -> list[str]:
    """Nuisances of which the sheet's value is wrong for certain; adequate: as of `baseline_values`."""
    return [b.estimate.name for b in baseline_values(problem, state, adequate=adequate) if b.sure]


def beyond_prior(nuisance: Parameter, e: f.Estimate) -> bool:
    """Whether the whole interval of a nuisance lies beyond two standard deviations of its prior: chance and scatter are both ruled out."""
    reach = SHEET_ALLOWS * (nuisance.prior_sd or 0.0)
    low, high = (-np.inf if e.low is None else e.low), (np.inf if e.high is None else e.high)
    return bool(low > nuisance.value + reach or high < nuisance.value - reach)


def edge_of_sheet(nuisance: Parameter, values: Values) -> float:
    """The end of what the sheet allows on the side of the fitted value."""
    reach = SHEET_ALLOWS * (nuisance.prior_sd or 0.0)
    return float(np.clip(values.shared[nuisance.name], nuisance.value - reach, nuisance.value + reach))


def channel_noise(problem: Problem, state: State) -> list[f.ChannelNoise]:
    """Final one-step error of each channel, and the test for whiteness."""
    spread = state.noise.innovation_sd(problem)
    orders = {
        name: state.noise.whiteners[block.group].order for block in problem.blocks for name in block.channels
    }
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
    """p-value of the test of Ljung and Box (1978) over 20 lags; 1 with too few rows for a test."""
    n = innovations.size
    lags = min(WHITE_LAGS, n // 5)
    if lags <= order + 1:
        return 1.0
    e = innovations - np.mean(innovations)
    power = float(e @ e)
    q = sum((float(e[k:] @ e[:-k]) / power) ** 2 / (n - k) for k in range(1, lags + 1))
    return float(chi2.sf(n * (n + 2) * q, lags - order))
