"""From a finished search to a verdict: what is left out, what cannot be told, and why.

Gates after the search: every effect must still be needed beside the others (backward elimination); it must close at
least half of the gap between the model without it and the floor, the best that anything, the library or
functions of the known signals, achieves on held-out rows; else it is the best proxy and the cause is unknown.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from discrepancy import findings as f
from discrepancy.fit import Fit, fit
from discrepancy.groups import ENOUGH, Member, members, separating
from discrepancy.locate import locate
from discrepancy.model import Effect, Parameter
from discrepancy.noise import Noise
from discrepancy.openended import OpenEnded, explore
from discrepancy.problem import Problem, Unusable
from discrepancy.recording import Array
from discrepancy.screen import Score, active, inflation_of, penalty, sensitivities, time_blocks
from discrepancy.search import (
    Progress,
    Settings,
    State,
    assess,
    free_names,
    held_out_residual,
    project_out,
    screen,
    search,
)

ENOUGH_POWER = 0.8
FEW_SAMPLES = 30
STRAINED = 3.0  # standard deviations of its prior beyond which a nuisance stands in for something else
TOUCHED = 0.1  # share of the gain that makes a channel one the effect acts on
WHITE_LAGS = 20


@dataclass(frozen=True, slots=True)
class _Needed:
    """An accepted effect, the fit without it, its gain, and the share of the gap it closes on held-out rows."""

    effect: str
    without: Fit
    gain: float
    needed: float
    held_out_gain: float
    gap_closed: float
    error_ratio: dict[str, float]


def judge(problem: Problem, settings: Settings, progress: Progress = lambda _: None) -> f.Findings:
    """Search, then decide. Never raises for what recordings contain; Unusable is raised when Problem is built."""
    state, history = search(problem, settings, progress)
    state = backward(problem, state, settings)
    progress("looking for what the library does not explain")
    beyond = explore(problem, state, settings) if settings.open_ended else OpenEnded((), 0.0, 0.0, {}, 0)
    needed = [_weigh(problem, state, name, beyond, settings) for name in state.accepted]
    progress("locating, grouping")
    found = [_finding(problem, state, history[0], n, settings) for n in needed]
    # the fits of the search are forward; report in order of evidence
    found.sort(key=lambda finding: -finding.gain)
    candidates = _candidates(problem, state, history[0], found, settings)
    status, reasons = _status(problem, found, beyond, candidates)
    return f.Findings(
        model=problem.model.name,
        recordings=list(dict.fromkeys(w.recording for w in problem.windows)),
        status=status,
        reasons=reasons,
        findings=found,
        open_ended=_open(beyond),
        candidates=candidates,
        nuisances=_nuisances(problem, state),
        noise=_noise(problem, state),
        missing_channels=list(problem.missing),
        complaints=_complaints(problem),
        simulations=problem.simulations,
        samples=int(problem.measured.size),
    )


def nothing_usable(model: str, recordings: Sequence[str], error: Unusable) -> f.Findings:
    """The verdict on recordings that cannot be used at all."""
    return f.Findings(model=model, recordings=list(recordings), status="inconclusive", reasons=[str(error)])


def backward(problem: Problem, state: State, settings: Settings) -> State:
    """Drop accepted effects that the others have made superfluous, weakest first."""
    while len(state.accepted) > 1:
        gains = {}
        for name in state.accepted:
            others = tuple(n for n in state.accepted if n != name)
            gains[name] = _without(problem, state, others).sse - state.fit.sse
        weakest = min(gains, key=lambda n: gains[n])
        least = penalty(problem.model.effect(weakest).size, len(problem.model.effects), settings.alpha)
        if gains[weakest] > least:
            break
        kept = tuple(n for n in state.accepted if n != weakest)
        state = replace(
            assess(problem, kept, _without(problem, state, kept).values, settings), trials=state.trials
        )
    return state


def _without(problem: Problem, state: State, others: tuple[str, ...]) -> Fit:
    """The fit with only `others` on, the rest switched off again."""
    off = {
        p.name: p.value
        for name in state.accepted
        if name not in others
        for p in problem.model.effect(name).parameters
    }
    return fit(problem, state.noise, free_names(problem, others), state.fit.values.with_shared(off))


def _weigh(problem: Problem, state: State, name: str, beyond: OpenEnded, settings: Settings) -> _Needed:
    others = tuple(n for n in state.accepted if n != name)
    without = _without(problem, state, others)
    before = held_out_residual(problem, state.noise, others, without.values, settings)
    after = held_out_residual(problem, state.noise, state.accepted, state.fit.values, settings)
    rows = {c: state.noise.row_channel == i for i, c in enumerate(problem.channels)}
    gains = {c: float(np.sum(before[r] ** 2) - np.sum(after[r] ** 2)) for c, r in rows.items()}
    gained = sum(gains.values())
    # what is left in channels the effect does not touch says nothing about it
    touched = [c for c, gain in gains.items() if gain > TOUCHED * gained]
    gap = gained + sum(max(beyond.held_out_gains.get(c, 0.0), 0.0) for c in touched)
    ratio = {
        c: float(np.sqrt(np.mean(after[r] ** 2) / np.mean(before[r] ** 2)))
        for c, r in rows.items()
        if r.any()
    }
    return _Needed(
        effect=name,
        without=without,
        gain=without.sse - state.fit.sse,
        needed=penalty(problem.model.effect(name).size, len(problem.model.effects), settings.alpha),
        held_out_gain=gained,
        gap_closed=float(np.clip(gained / gap, 0.0, 1.0)) if gap > 0.0 else 0.0,
        error_ratio=ratio,
    )


def _finding(
    problem: Problem, state: State, baseline: State, needed: _Needed, settings: Settings
) -> f.Finding:
    others = tuple(n for n in state.accepted if n != needed.effect)
    scores = _scores_without(problem, state, others, needed.without, settings)
    alike = members(problem, state, needed.effect, needed.without, scores, settings)
    best, rest = alike[0], alike[1:]
    effect = problem.model.effect(best.effect)
    where = locate(problem, state.noise, needed.without, best.fit)
    absorbed = next((s.absorbed for s in baseline.scores if s.effect == effect.name), 0.0)
    doubts = _doubts(problem, effect, best.fit)
    if needed.gap_closed < settings.gap_closed:
        doubts.insert(0, f"closes {needed.gap_closed:.0%} of the gap on held-out data")
    return f.Finding(
        effect=effect.name,
        named=not doubts,
        doubts=doubts,
        kind=effect.kind,
        place=effect.place,
        sentence=effect.sentence,
        equation=effect.equation,
        parameters=[estimate(p, best.fit, state.noise) for p in effect.parameters],
        gain=needed.gain,
        needed=needed.needed,
        held_out_gain=needed.held_out_gain,
        gap_closed=needed.gap_closed,
        absorbed=absorbed,
        held_out_error=needed.error_ratio,
        group=[
            f.GroupMember(
                effect=m.effect,
                likelihood_difference=m.difference,
                collinearity=m.collinearity,
                parameters=[
                    estimate(p, m.fit, state.noise) for p in problem.model.effect(m.effect).parameters
                ],
            )
            for m in rest
        ],
        separate_by=[s for m in rest if (s := _separation(problem, state, effect, best, m)) is not None],
        where=f.Where(
            channels=dict(where.channels),
            throughout=where.throughout,
            intervals=[
                f.Interval(recording=s.recording, start_s=s.start_s, end_s=s.end_s, share=s.share)
                for s in where.stretches
            ],
            regimes=[f.Regime(text=r.text, share=r.share, density=r.density) for r in where.regimes],
        ),
    )


def _scores_without(
    problem: Problem, state: State, others: tuple[str, ...], without: Fit, settings: Settings
) -> list[Score]:
    """Screen of the library with one accepted effect taken out again."""
    base = problem.predict(without.values)
    columns = [
        sensitivities(problem, without.values, base, e) for e in problem.model.effects if e.name not in others
    ]
    return screen(problem, state.noise, without, columns, settings)


def _doubts(problem: Problem, effect: Effect, fitted: Fit) -> list[str]:
    """Reasons not to trust a name: physics asked for more than can be, from the effect or from a nuisance."""
    ends = [estimate(problem.model.parameter(n), fitted) for n in active(effect)]
    doubts = []
    if all(e.at_bound is not None and e.value != problem.model.parameter(e.name).value for e in ends):
        doubts.append(f"{ends[0].name} stops at its physical bound, {ends[0].value:g} {ends[0].unit}")
    for p in [p for p in problem.model.nuisances if p.prior_sd is not None and p.name in fitted.names]:
        value = fitted.values.shared[p.name]
        away = abs(value - p.value) / (p.prior_sd or 1.0)
        if away > STRAINED or estimate(p, fitted).at_bound is not None:
            doubts.append(
                f"the nuisance {p.name} was pushed to {value:.4g} {p.unit}, {away:.1f} sd from its prior"
            )
    return doubts


def _separation(
    problem: Problem, state: State, effect: Effect, best: Member, other: Member
) -> f.Separation | None:
    computed = separating(problem, state.noise, best, other)
    if computed is not None and computed.difference > ENOUGH:
        return f.Separation(
            effect=other.effect, manoeuvre=computed.sentence, expected_difference=computed.difference
        )
    known = {**problem.model.effect(other.effect).confusable, **effect.confusable}
    text = known.get(other.effect, known.get(effect.name))
    return f.Separation(effect=other.effect, manoeuvre=text, expected_difference=None) if text else None


def estimate(parameter: Parameter, fitted: Fit, noise: Noise | None = None) -> f.Estimate:
    """Value and 95 % interval within the bounds, wider where the scores are correlated over time."""
    value, sd = fitted.values.shared[parameter.name], fitted.sd(parameter.name)
    if noise is not None:
        direction = project_out(fitted, [fitted.names.index(parameter.name)])
        sd *= (
            float(np.sqrt(inflation_of(direction, fitted.residual, time_blocks(noise))))
            if direction.any()
            else 1.0
        )
    close = 1e-3 * abs(parameter.typical)
    # the end of a sign or a time constant's zero is its meaning, not a wall
    at = "lower" if value - parameter.lower < close else "upper" if parameter.upper - value < close else None
    return f.Estimate(
        name=parameter.name,
        value=value,
        low=max(value - 1.96 * sd, parameter.lower),
        high=min(value + 1.96 * sd, parameter.upper),
        unit=parameter.unit,
        at_bound=at,
    )


def _candidates(
    problem: Problem, state: State, baseline: State, found: Sequence[f.Finding], settings: Settings
) -> list[f.Candidate]:
    final = {s.effect: s for s in state.scores}
    first = {s.effect: s for s in baseline.scores}
    names = {x.effect for x in found}
    grouped = {m.effect for x in found for m in x.group}
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
        elif last.power < ENOUGH_POWER:
            text = f"a typical {effect.name} would be noticed with probability {last.power:.2f}"
            verdict, reason = "could not be judged", f"{text}; needs {effect.excited_by or 'more data'}"
        elif first[score.effect].statistic > penalty(
            len(active(effect)), len(problem.model.effects), settings.alpha
        ):
            verdict, reason = "not needed", "what speaks for it is explained better by a finding"
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


def _why_invisible(problem: Problem, effect: Effect) -> str:
    gone = [name for name in problem.missing if name in effect.place or name in effect.excited_by]
    if gone:
        return f"channel {', '.join(gone)} was not recorded"
    return f"leaves no trace beyond the nuisances in these recordings; needs {effect.excited_by or 'another channel'}"


def _expected(effect: Effect, score: Score) -> list[f.Estimate]:
    switches = [p for p in effect.parameters if not p.shape]
    if score.power == 0.0:
        return []
    return [
        f.Estimate(name=p.name, value=float(p.value + c), low=None, high=None, unit=p.unit)
        for p, c in zip(switches, score.change, strict=True)
    ]


def _status(
    problem: Problem, found: Sequence[f.Finding], beyond: OpenEnded, candidates: Sequence[f.Candidate]
) -> tuple[f.Status, list[str]]:
    reasons: list[str] = []
    if beyond.terms:
        reasons.append(f"the library leaves something that depends on known signals: {beyond.equation()}")
    reasons += [
        f"{x.effect} is the best proxy, cause unknown: {'; '.join(x.doubts)}" for x in found if not x.named
    ]
    if any(x.named for x in found):
        return "explained", reasons or ["what was found brings held-out errors to the floor"]
    if found or beyond.terms:
        return "unknown", reasons
    if problem.measured.size < FEW_SAMPLES:
        return "inconclusive", [f"{problem.measured.size} samples are too few to judge anything"]
    blind = [c for c in candidates if c.verdict == "could not be judged"]
    if candidates and len(blind) == len(candidates):
        return "inconclusive", ["none of the library's effects would have been noticed at a typical size"]
    reasons.append("no effect and no function of the known signals improves the prediction of held-out data")
    if blind:
        reasons.append(f"could not be judged here: {', '.join(c.effect for c in blind)}")
    return "nothing missing", reasons


def _open(beyond: OpenEnded) -> f.OpenEquation | None:
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


def _nuisances(problem: Problem, state: State) -> list[f.Nuisance]:
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


def _noise(problem: Problem, state: State) -> list[f.ChannelNoise]:
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


def _complaints(problem: Problem) -> list[f.Complaint]:
    return [
        f.Complaint(recording=c.recording, signal=c.signal, text=c.text, fatal=c.fatal)
        for c in problem.complaints
    ]
