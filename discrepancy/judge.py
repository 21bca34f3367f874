"""From a finished search to a verdict: what is left out, what cannot be told, and why.

Gates after the search: every effect must still be needed beside the others (backward elimination); it must close at
least half of the gap between the model without it and the floor, the best that anything, the library or
functions of the known signals, achieves on held-out rows; else it is the best proxy and the cause is unknown.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from discrepancy import account
from discrepancy import findings as f
from discrepancy.assess import screen
from discrepancy.doubts import doubts
from discrepancy.fit import Fit
from discrepancy.groups import ENOUGH, Member, members, separating
from discrepancy.locate import locate
from discrepancy.missing import missing_channels
from discrepancy.model import Effect
from discrepancy.openended import OpenEnded, explore
from discrepancy.problem import Problem, Unusable
from discrepancy.screen import Score, sensitivities
from discrepancy.search import passed, search
from discrepancy.spells import spell_of, within
from discrepancy.state import Progress, Settings, State
from discrepancy.verdict import verdict
from discrepancy.weighing import Needed, backward, beside_others


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
    needed = beside_others(problem, state, on_the_way, beyond, settings)
    progress("locating, grouping")
    found = [_finding(problem, state, history[0], n, beyond, settings) for n in needed]
    # the fits of the search are forward; report in order of evidence
    found.sort(key=lambda finding: -finding.gain)
    candidates = account.candidates(problem, state, history[0], found, settings)
    status, reasons = verdict(problem, state, left_over, found, beyond, candidates, settings)
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


def _finding(
    problem: Problem, state: State, baseline: State, needed: Needed, beyond: OpenEnded, settings: Settings
) -> f.Finding:
    others = tuple(n for n in state.accepted if n != needed.effect)
    spell = spell_of(problem.model.effect(needed.effect), state.fit.values)
    scores = _scores_without(problem, state, others, needed.without, spell, settings)
    alike = members(problem, state, needed.effect, needed.without, scores, settings)
    best, rest = alike[0], alike[1:]
    effect = problem.model.effect(best.effect)
    where = locate(problem, state.noise, needed.without, best.fit, spell_of(effect, best.fit.values))
    absorbed = next((s.absorbed for s in baseline.scores if s.effect == effect.name), 0.0)
    against = doubts(problem, state, needed, effect, best.fit, beyond, settings)
    return f.Finding(
        effect=effect.name,
        named=not against,
        doubts=against,
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
