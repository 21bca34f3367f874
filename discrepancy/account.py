"""The parts of a result that only restate: parameters with intervals, the ranking, nuisances, noise."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2
from scipy.stats import t as student

from discrepancy import findings as f
from discrepancy.fit import Fit
from discrepancy.model import Effect, Parameter
from discrepancy.noise import Noise
from discrepancy.openended import OpenEnded
from discrepancy.problem import Problem
from discrepancy.recording import Array
from discrepancy.screen import Score, active, jackknife, penalty, stretches, switches
from discrepancy.state import Settings, State, Trial

ENOUGH_POWER = 0.8
TWIN = 0.95  # share of an effect that the nuisances can do, from which no driving tells them apart
WHITE_LAGS = 20


def estimate(parameter: Parameter, fitted: Fit, noise: Noise | None = None) -> f.Estimate:
    """Value and 95 % interval within the bounds, wider where scores are correlated over time or stretches disagree."""
    value, sd = fitted.values.shared[parameter.name], fitted.sd(parameter.name)
    reach = 1.96 * sd
    if noise is not None:
        blocks = stretches(noise)
        variance = jackknife(fitted, blocks)[fitted.names.index(parameter.name)]
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
    """Every effect of the library with its score on the baseline and what became of it."""
    final = {s.effect: s for s in state.scores}
    first = {s.effect: s for s in baseline.scores}
    names = {x.effect for x in found}
    grouped = {m.effect for x in found for m in x.group}
    small = _negligible(problem, (*baseline.trials, *state.trials))
    rows = []
    for score in baseline.scores:
        effect = problem.model.effect(score.effect)
        last = final.get(score.effect, score)
        verdict: f.Verdict
        if score.effect in names:
            verdict, reason = "found", "see findings"
        elif score.effect in grouped:
            verdict, reason = "confusable with a finding", "explains the recordings as well as a finding"
        elif score.power == 0.0:
            verdict, reason = "could not be judged", _why_invisible(problem, effect)
        elif last.power < ENOUGH_POWER and score.absorbed > TWIN:
            verdict, reason = (
                "could not be judged",
                "the baseline's own parameters can do the same; needs another channel",
            )
        elif last.power < ENOUGH_POWER:
            text = "a typical one would hardly be noticed here"
            verdict, reason = "could not be judged", f"{text}; needs {effect.excited_by or 'more data'}"
        elif score.effect in small:
            verdict, reason = "negligible", small[score.effect]
        elif first[score.effect].statistic > penalty(
            len(active(effect)), len(problem.model.effects), settings.alpha
        ):
            refuted = (
                "what speaks for it by itself does not stand up to a refit, or differs between stretches"
            )
            verdict, reason = (
                "not needed",
                "what speaks for it is explained better by a finding" if names else refuted,
            )
        else:
            verdict, reason = "ruled out", "a typical one would have been noticed"
        rows.append(
            f.Candidate(
                effect=effect.name,
                kind=effect.kind,
                verdict=verdict,
                statistic=score.statistic,
                p_value=score.p_value,
                expected=_expected(effect, score),
                power=last.power,
                absorbed=score.absorbed,
                reason=reason,
            )
        )
    return rows


def _negligible(problem: Problem, trials: Sequence[Trial]) -> dict[str, str]:
    """What was seen of effects that are significant and yet too small to matter."""
    least, told = problem.model.negligible, {}
    for t in [t for t in trials if t.gain > t.needed and t.negligible(problem)]:
        seen = [
            f"{p.name} = {t.fit.values.shared[p.name]:.3g} {p.unit}".removesuffix(" 1")
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
