"""From a finished search to a verdict: what is left out, what cannot be told, and why.

Gates after the search: every effect must still be needed beside the others (backward elimination); it must close at
least half of the gap between the model without it and the floor, the best that anything, the library or
functions of the known signals, achieves on held-out rows; else it is the best proxy and the cause is unknown.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from discrepancy import account
from discrepancy import findings as f
from discrepancy.assess import assess, screen
from discrepancy.fit import FORECAST, Fit, fit
from discrepancy.groups import ENOUGH, Member, members, separating
from discrepancy.locate import locate
from discrepancy.missing import missing_channels
from discrepancy.model import Effect
from discrepancy.openended import OpenEnded, explore
from discrepancy.problem import Problem, Unusable, Values
from discrepancy.recording import Array
from discrepancy.screen import Score, active, sensitivities
from discrepancy.search import passed, search
from discrepancy.spells import changing_nuisance, price, spell_of, within
from discrepancy.state import CLEAR, STRAINED, Progress, Settings, State, Trial, free_names
from discrepancy.trials import confirm, held_out_residual, size_of
from discrepancy.units import shown

FEW_SAMPLES = 30
NOTHING_KNOWN: Mapping[frozenset[str], Values] = {}
LEFT = 0.5  # share of its size that an effect keeps beside the open-ended equation, or it is a proxy
TOUCHED = 0.1  # share of the gain that makes a channel one the effect acts on


@dataclass(frozen=True, slots=True)
class _Needed:
    """An accepted effect, the fit without it, its gain, and the share of the gap it closes on held-out rows; seen: the gain without priors,

    which held-out rows do not know of.
    """

    effect: str
    without: Fit
    gain: float
    seen: float
    needed: float
    held_out_gain: float
    gap_closed: float
    error_ratio: dict[str, float]


@dataclass(frozen=True, slots=True)
class Judgement:
    """The findings and what they rest on; baseline: the search before anything was accepted."""

    findings: f.Findings
    problem: Problem
    baseline: State
    state: State
    beyond: OpenEnded


def judge(problem: Problem, settings: Settings, progress: Progress = lambda _: None) -> Judgement:
    """Search, then decide. Never raises for what recordings contain; Unusable is raised when Problem is built."""
    state, history = search(problem, settings, progress)
    left_over = passed(problem, state, settings)
    state = backward(problem, state, settings)
    progress("looking for what the library does not explain")
    beyond = explore(problem, state, settings) if settings.open_ended else OpenEnded((), 0.0, 0.0, {}, 0, {})
    on_the_way = {frozenset(h.accepted): h.fit.values for h in history}
    needed = _weighed(problem, state, on_the_way, beyond, settings)
    progress("locating, grouping")
    found = [_finding(problem, state, history[0], n, beyond, settings) for n in needed]
    # the fits of the search are forward; report in order of evidence
    found.sort(key=lambda finding: -finding.gain)
    candidates = account.candidates(problem, state, history[0], found, settings)
    silent = not found and not beyond.terms
    torn = _torn(problem, state, settings) if silent and not left_over else None
    status, reasons = _status(problem, found, beyond, candidates, torn)
    if left_over:
        status = "inconclusive" if status == "nothing missing" else status
        reasons += [
            f"the search ended at {settings.most_simulations} simulations though {t.effect} would help: the model is wrong by far, or in many ways"
            for t in left_over
        ]
    told = f.Findings(
        model=problem.model.name,
        recordings=list(dict.fromkeys(w.recording for w in problem.windows)),
        status=status,
        reasons=reasons,
        findings=found,
        open_ended=account.open_equation(beyond),
        candidates=candidates,
        nuisances=account.nuisances(problem, state),
        noise=account.channel_noise(problem, state),
        missing_channels=missing_channels(problem, state, candidates, found),
        complaints=list(problem.complaints),
        simulations=problem.simulations,
        samples=int(problem.measured.size),
    )
    return Judgement(told, problem, history[0], state, beyond)


def nothing_usable(model: str, recordings: Sequence[str], error: Unusable) -> f.Findings:
    """The verdict on recordings that cannot be used at all."""
    return f.Findings(
        model=model,
        recordings=list(recordings),
        status="inconclusive",
        reasons=error.reasons,
        complaints=list(error.complaints),
    )


def backward(problem: Problem, state: State, settings: Settings) -> State:
    """Drop accepted effects that the others have made superfluous, weakest first."""
    while len(state.accepted) > 1:
        gains = {}
        for name in state.accepted:
            others = tuple(n for n in state.accepted if n != name)
            gains[name] = _without(problem, state, others).sse - state.fit.sse
        weakest = min(gains, key=lambda n: gains[n])
        least = price(problem, problem.model.effect(weakest), state.fit.values, settings.alpha)
        size = size_of(problem.model.effect(weakest), state.fit)
        if gains[weakest] > least and size >= problem.model.negligible:
            break
        kept = tuple(n for n in state.accepted if n != weakest)
        state = replace(
            assess(problem, kept, _without(problem, state, kept).values, settings), trials=state.trials
        )
    return state


def _without(
    problem: Problem,
    state: State,
    others: tuple[str, ...],
    known: Mapping[frozenset[str], Values] = NOTHING_KNOWN,
) -> Fit:
    """The fit with only `others` on, the rest switched off again; known: where the search stood with which effects, to begin from."""
    off = {
        p.name: p.value
        for name in state.accepted
        if name not in others
        for p in problem.model.effect(name).parameters
    }
    start = known.get(frozenset(others), state.fit.values.with_shared(off))
    return fit(problem, state.noise, free_names(problem, others), start, rough=True)


def _weighed(
    problem: Problem,
    state: State,
    known: Mapping[frozenset[str], Values],
    beyond: OpenEnded,
    settings: Settings,
) -> list[_Needed]:
    """Every accepted effect, weighed beside the others."""
    if not state.accepted:
        return []
    after = held_out_residual(problem, state.noise, state.accepted, state.fit.values, settings)
    return [_weigh(problem, state, name, after, known, beyond, settings) for name in state.accepted]


def _weigh(
    problem: Problem,
    state: State,
    name: str,
    after: Array,
    known: Mapping[frozenset[str], Values],
    beyond: OpenEnded,
    settings: Settings,
) -> _Needed:
    """after: the held-out residual with all that was accepted."""
    others = tuple(n for n in state.accepted if n != name)
    without = _without(problem, state, others, known)
    before = held_out_residual(problem, state.noise, others, without.values, settings)
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
        seen=without.data_sse - state.fit.data_sse,
        needed=price(problem, problem.model.effect(name), state.fit.values, settings.alpha),
        held_out_gain=gained,
        gap_closed=float(np.clip(gained / gap, 0.0, 1.0)) if gap > 0.0 else 0.0,
        error_ratio=ratio,
    )


def _finding(
    problem: Problem, state: State, baseline: State, needed: _Needed, beyond: OpenEnded, settings: Settings
) -> f.Finding:
    others = tuple(n for n in state.accepted if n != needed.effect)
    spell = spell_of(problem.model.effect(needed.effect), state.fit.values)
    scores = _scores_without(problem, state, others, needed.without, spell, settings)
    alike = members(problem, state, needed.effect, needed.without, scores, settings)
    best, rest = alike[0], alike[1:]
    effect = problem.model.effect(best.effect)
    where = locate(problem, state.noise, needed.without, best.fit, spell_of(effect, best.fit.values))
    absorbed = next((s.absorbed for s in baseline.scores if s.effect == effect.name), 0.0)
    doubts = _doubts(problem, effect, best.fit)
    doubts += _superseded(problem, state, needed, beyond, settings)
    doubts += _drifting(problem, state, needed, settings) if spell is not None else []
    if needed.held_out_gain < settings.least_held_out(needed.seen):
        text = f"gains {needed.seen:.0f} where it is fitted, beside the others, and {needed.held_out_gain:.0f} on held-out data"
        doubts.insert(0, text)
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
        parameters=[account.estimate(p, best.fit, state.noise) for p in effect.parameters],
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
                    account.estimate(p, m.fit, state.noise) for p in problem.model.effect(m.effect).parameters
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
    problem: Problem,
    state: State,
    others: tuple[str, ...],
    without: Fit,
    spell: range | None,
    settings: Settings,
) -> list[Score]:
    """Screen of the library with one accepted effect taken out again; spell: the windows in which it acted, if not in all."""
    base = problem.predict(without.values)
    rest = [e for e in problem.model.effects if e.name not in others]
    columns = sensitivities(problem, without.values, base, rest, rough=True)
    if spell is not None:
        columns = within(problem, columns, spell)
    return screen(problem, state.noise, without, columns, settings)


def _doubts(problem: Problem, effect: Effect, fitted: Fit) -> list[str]:
    """Reasons not to trust a name: physics asked for more than can be, from the effect or from a nuisance."""
    ends = [account.estimate(problem.model.parameter(n), fitted) for n in active(effect)]
    doubts = []
    if all(e.at_bound is not None and e.value != problem.model.parameter(e.name).value for e in ends):
        doubts.append(
            f"{ends[0].name} stops at its physical bound, {ends[0].value:g} {shown(ends[0].unit)}".rstrip()
        )
    for p in [p for p in problem.model.nuisances if p.prior_sd is not None and p.name in fitted.names]:
        value = fitted.values.shared[p.name]
        away = abs(value - p.value) / (p.prior_sd or 1.0)
        if away > STRAINED or account.estimate(p, fitted).at_bound is not None:
            doubts.append(
                f"the nuisance {p.name} was pushed to {value:.4g} {p.unit}, {away:.1f} sd from its prior"
            )
    return doubts


def _superseded(
    problem: Problem, state: State, needed: _Needed, beyond: OpenEnded, settings: Settings
) -> list[str]:
    """An effect stood in for the open-ended equation if nothing significant is left of it beside the equation,
    and the equation in its place does as well.
    """
    effect = problem.model.effect(needed.effect)
    if effect.size != 1 or not beyond.terms:
        return []
    p = effect.parameters[0]
    size = state.fit.values.shared[p.name] - p.value
    shift, sd = beyond.beside[p.name]
    left = size + shift
    if left / size > LEFT or (left / sd) ** 2 > needed.needed:
        return []
    others = tuple(n for n in state.accepted if n != needed.effect)
    instead = explore(problem, State(state.noise, needed.without, others, ()), settings)
    if instead.held_out_gain < needed.held_out_gain - settings.same:
        return []
    return [
        f"beside {beyond.equation()} its {p.name} would go from {p.value + size:.3g} to {p.value + left:.3g}"
    ]


def _drifting(problem: Problem, state: State, needed: _Needed, settings: Settings) -> list[str]:
    """An effect that acts for a while may stand in for a baseline parameter that is not the same all the time."""
    rival = changing_nuisance(problem, state.noise, needed.without)
    if rival is None or rival[1] < (1.0 - FORECAST) * needed.gain - settings.same:
        return []
    name, _, windows = rival
    start, end = problem.windows[windows.start].start_s, problem.windows[windows.stop - 1].end_s
    return [f"the nuisance {name} would do as well if it were another from {start:.4g} to {end:.4g} s"]


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


def _torn(problem: Problem, state: State, settings: Settings) -> Trial | None:
    """The effect that helps held-out data far beyond chance though stretches of time disagree about it, if there is one: something is missing."""
    likely = max(state.trials, key=lambda t: t.lead, default=None)
    if likely is None or likely.plain < max(CLEAR, likely.needed):
        return None
    tried = confirm(problem, likely.beside or state, likely, settings)
    held_out = tried.held_out_gain or 0.0
    return tried if held_out > settings.confirmed * likely.plain and not tried.negligible(problem) else None


def _status(
    problem: Problem,
    found: Sequence[f.Finding],
    beyond: OpenEnded,
    candidates: Sequence[f.Candidate],
    torn: Trial | None,
) -> tuple[f.Status, list[str]]:
    reasons: list[str] = []
    if torn is not None:
        return "unknown", [
            f"{torn.effect} would help much ({torn.plain:.0f} where {torn.needed:.0f} is needed), but stretches of time disagree about it"
        ]
    if beyond.terms:
        reasons.append(f"the library leaves something that depends on known signals: {beyond.equation()}")
    reasons += [
        f"{x.effect} is the best proxy, cause unknown: {'; '.join(x.doubts)}" for x in found if not x.named
    ]
    wrong = [c.told for c in problem.complaints if c.fatal and c.signal in problem.missing]
    if any(x.named for x in found):
        return "explained", [
            *(
                reasons
                or [
                    "with it, no other effect and no known signal predicts the data that was not fitted any better"
                ]
            ),
            *wrong,
        ]
    if found or beyond.terms:
        return "unknown", [*reasons, *wrong]
    if problem.measured.size < FEW_SAMPLES:
        return "inconclusive", [f"{problem.measured.size} samples are too few to judge anything"]
    blind = [c for c in candidates if c.verdict == "could not be judged"]
    if candidates and len(blind) == len(candidates):
        return "inconclusive", ["none of the library's effects would have been noticed at a typical size"]
    reasons.append("no effect and no function of the known signals improves the prediction of held-out data")
    if blind:
        reasons.append(f"could not be judged here: {', '.join(c.effect for c in blind)}")
    if wrong:
        channels = ", ".join(problem.channels)
        return "inconclusive", [*wrong, f"in {channels} alone {reasons[0]}", *reasons[1:]]
    dead = [c.told for c in problem.complaints if c.signal in problem.missing]
    return "nothing missing", [*reasons, *dead]
