"""From a finished search to a verdict: which effects are named, which cannot be distinguished, and why.

After the search every effect must still be needed beside the others (backward elimination). It must also close at least half of the gap
between the model without it and the best prediction of held-out rows, by the library or by functions of the known signals. Otherwise it is
the best proxy and the cause is unknown. All thresholds are in discrepancy.gates.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

from discrepancy.decision import summary
from discrepancy.decision.adequacy import adequacy, certain, first_look
from discrepancy.decision.again.beside import Beside, beside_equation
from discrepancy.decision.again.cut_short import cut_short
from discrepancy.decision.again.namesakes import apart, without_namesakes
from discrepancy.decision.again.other_way import doubted, other_way
from discrepancy.decision.again.times import with_times
from discrepancy.decision.caveats import beside_rest, caveats_of, hanging, hangs_on, of_the_step
from discrepancy.decision.drop_one import DropOneTest, backward, drop_one_tests
from discrepancy.decision.groups import Alternative, alternatives, separation
from discrepancy.decision.judgement import Judgement
from discrepancy.decision.location import locate
from discrepancy.decision.missing_channels import missing_channels
from discrepancy.decision.not_accepted import taken_over
from discrepancy.decision.not_understood import complaints_of, intervals_not_understood
from discrepancy.decision.rates import at_both_rates, at_models_rate
from discrepancy.decision.sizes.half_step import HalfStep, at_half_step
from discrepancy.decision.sizes.of_a_wrong_model import of_a_wrong_model
from discrepancy.decision.sizes.without_proxies import hanging_on_proxies
from discrepancy.decision.stand_ins import with_stand_ins
from discrepancy.decision.verdict import verdict
from discrepancy.estimation.fit import Fit
from discrepancy.estimation.noise import Noise
from discrepancy.estimation.problem import Problem, Unusable, Values, Windows
from discrepancy.model.description import Effect
from discrepancy.selection.active_intervals import active_interval_of, restricted_to
from discrepancy.selection.assess import screen
from discrepancy.selection.open_ended import OpenEnded, explore
from discrepancy.selection.own_noise import under_own_noise
from discrepancy.selection.screen import Score, sensitivities
from discrepancy.selection.search import best_confirmed, over_budget, search, searched_on
from discrepancy.selection.starts import Starts
from discrepancy.selection.state import CandidateFit, Progress, Settings, State
from discrepancy.signals import findings as f
from discrepancy.signals.recording import Complaint

WIDER: Final = 10.0  # how many times less the sheet is trusted on a value that the recordings contradict
MOST_SWAPS: Final = 2  # of a verdict; each one costs all its tests again


def judge(
    problem: Problem,
    settings: Settings,
    progress: Progress = lambda _: None,
    complaints: Sequence[Complaint] = (),
) -> Judgement:
    """The verdict on a problem; where the time of the settings is over before, on what was found until then. complaints: about the recordings,
    beside those of the problem.

    Content of recordings never raises here; Unusable is raised when the Problem is built.
    """
    first = _judged(problem, settings, progress, complaints)
    if settings.over():
        return cut_short(first, whole=False)
    timed = with_times(first, lambda cut: _judged(cut, settings, progress, complaints), settings, progress)
    if settings.over():
        return cut_short(first, whole=True)
    other, better = other_way(
        timed,
        lambda state: _judged(timed.sheet, settings, progress, complaints, begin=state),
        settings,
        progress,
    )
    if settings.over():
        return cut_short(timed, whole=True)
    last = beside_equation(
        other, lambda grown, beside: _judged(grown, settings, progress, complaints, beside), progress
    )
    return cut_short(doubted(other, better), whole=True) if settings.over() else doubted(last, better)


def _judged(
    problem: Problem,
    settings: Settings,
    progress: Progress,
    complaints: Sequence[Complaint],
    beside: Beside | None = None,
    begin: tuple[State, State] | None = None,
) -> Judgement:
    """The verdict of one search. beside: an equation in the problem's baseline; begin: the baseline's state and one to search on from."""
    complaints = [*complaints, *problem.complaints]

    def look(noise: Noise, fitted: Fit) -> None:
        if beside is None:  # an equation is no baseline
            progress(first_look(problem, noise, fitted))

    sheet = problem
    problem, state, history = _searched(sheet, settings, progress, look, beside is None, begin)
    baseline = beside.before() if beside else history[0]
    complaints += complaints_of(problem, history[0])
    left_over = best_confirmed(problem, state, settings)
    compared = _compared(
        problem, backward(problem, state, settings, _on_the_way(history)), history, settings, progress
    )
    for _ in range(MOST_SWAPS):
        swapped = without_namesakes(problem, compared.state, compared.rivals, settings)
        if swapped is None:
            break
        progress(f"one effect is the best name twice; trying {', '.join(swapped.accepted)}")
        compared = _compared(problem, swapped, history, settings, progress)
    compared = replace(compared, rivals=apart(compared.rivals))
    state, left = compared.state, compared.left
    # without an effect the second verdict says no more than the first, and nobody reads its equation
    equation = beside.equation(problem, state, left, settings) if beside and state.accepted else left
    progress("comparing errors with their budgets")
    channels = adequacy(problem, baseline, state)
    exact = certain(problem, channels)
    half = at_half_step(problem, state.noise, state.fit)
    found, unsure = _findings(sheet, problem, compared, history, beside, equation, exact, half, settings)
    found, at_rates = at_both_rates(problem, state, found, at_models_rate(problem, state, settings))
    found = hanging_on_proxies(problem, state.fit, found)
    found = of_a_wrong_model(problem, found, channels, equation)
    # the order of acceptance is not that of the evidence
    found.sort(key=lambda finding: -finding.sse_reduction)
    candidates = summary.candidates(problem, state, history[0], found, settings)
    # an equation or a proxy stands for physics that the library has not: with it the model is known to be wrong
    known = not (equation.terms or left.unconfirmed) and all(finding.named for finding in found)
    values = summary.baseline_values(sheet, state, adequate=known and exact)
    values = [replace(v, sure=v.sure and v.estimate.name not in unsure) for v in values]
    values = with_stand_ins(sheet, state, values, settings)
    candidates = summary.beside_values(candidates, values)
    status, reasons = verdict(
        problem,
        state,
        left_over,
        found,
        equation,
        candidates,
        complaints,
        channels,
        values,
        settings,
        len(history[-1].accepted),
    )
    reasons += [*at_rates, *(half.said(problem.model.step_s) if half else [])]
    if unclear := intervals_not_understood(problem, history[0]):
        status, reasons = f.LESS_SURE.get(status, status), [*unclear, *reasons]
    findings = f.Findings(
        model=problem.model.name,
        recordings=list(dict.fromkeys(w.recording for w in problem.windows)),
        status=status,
        reasons=reasons,
        findings=found,
        adequacy=channels,
        open_ended=summary.open_equation(equation),
        candidates=candidates,
        baseline_values=values,
        nuisances=summary.nuisances(beside.plain if beside else sheet, state),
        noise=summary.channel_noise(problem, state),
        missing_channels=missing_channels(problem, state, candidates, found, complaints),
        complaints=complaints,
        simulations=problem.simulations,
        samples=problem.samples,
    )
    return Judgement(
        findings, problem, sheet, baseline, state, left, {r[0].effect: r for r in compared.rivals}
    )


def _findings(
    sheet: Problem,
    problem: Problem,
    compared: "_Compared",
    history: Sequence[State],
    beside: Beside | None,
    equation: OpenEnded,
    exact: bool,
    half: HalfStep | None,
    settings: Settings,
) -> tuple[list[f.Finding], set[str]]:
    """The accepted effects as findings, and values that contradict their sheet but are not sure, because a finding hangs on them.

    exact: whether the model simulates as well as its sensors read; half: what half of its step changes.
    """
    state, left = compared.state, compared.left
    found, unsure = list[f.Finding](), set[str]()
    # where nothing at all is left to explain, the two causes are the best there is
    more = left.terms or left.unconfirmed
    wrong = summary.baseline_values(sheet, state, adequate=False) if more else []
    stated = set(problem.channels) <= set(problem.model.disturbances)
    for test, rivals in zip(compared.tests, compared.rivals, strict=True):
        effect, fitted = problem.model.effect(rivals[0].effect), rivals[0].fit
        caveats = caveats_of(problem, state, test, effect, fitted, left, settings)
        caveats += beside.caveats(problem, state, test, equation) if beside else []
        caveats += beside_rest(test, _confounded(history[0], effect), stated=stated) if not exact else []
        caveats += of_the_step(problem, state, effect, half)
        hung = hangs_on(wrong, sheet, effect, fitted)
        caveats += hanging(hung, sheet, fitted)
        unsure |= {value.estimate.name for value in hung}
        if not caveats:  # costs two fits for each candidate that was not accepted
            caveats += taken_over(problem, state, history[-1].trials, test, [a.effect for a in rivals])
        found.append(_finding(problem, state, history[0], test, rivals, caveats))
    return found, unsure


def _searched(
    sheet: Problem,
    settings: Settings,
    progress: Progress,
    look: Callable[[Noise, Fit], None],
    doubting: bool,
    begin: tuple[State, State] | None = None,
) -> tuple[Problem, State, list[State]]:
    """The problem of the last state, that state, and those on the way; doubting: where a value of the sheet is wrong, the problem trusts it less."""
    if begin is None:
        state, history = search(sheet, settings, progress, look)
    else:
        state, history = searched_on(sheet, begin[1], settings, progress)
        history = [begin[0], *history]
    while not settings.over() and (found := _hidden_by_noise(sheet, state, history, settings, progress)):
        state, more = searched_on(sheet, state, settings, progress, found)
        history += more
    # without a finding there is no name that the sheet's value could make a proxy
    wrong = summary.sure_values(sheet, state, adequate=True) if doubting and state.accepted else []
    if not wrong or settings.over():
        return sheet, state, history
    progress(f"the recordings contradict the baseline's {', '.join(wrong)}; searching on without the prior")
    trusting = sheet.trusting_less(wrong, WIDER)
    other, more = searched_on(trusting, state, settings, progress)
    adequate = all(c.adequate for c in adequacy(trusting, history[0], other))
    # in a model that is still wrong, a value without a prior goes wherever it can stand in for what is missing
    if not set(wrong) <= set(summary.sure_values(sheet, other, adequate=adequate)):
        return sheet, state, history
    return trusting, other, [*history, *more]


def _hidden_by_noise(
    problem: Problem, state: State, history: Sequence[State], settings: Settings, progress: Progress
) -> list[CandidateFit]:
    """An effect that the noise of the search hides, where the search ended with errors over budget and could go on."""
    if len(state.accepted) >= settings.most_effects or over_budget(problem, settings):
        return []
    if all(c.adequate for c in adequacy(problem, history[0], state)):
        return []
    progress("errors are over their budgets: trying effects under the noise that each of them leaves")
    return under_own_noise(problem, state, settings)


@dataclass(frozen=True, slots=True)
class _Compared:
    """Accepted effects compared with what leaving them out, an equation, and other effects in their place give."""

    state: State
    left: OpenEnded
    tests: Sequence[DropOneTest]
    rivals: Sequence[Sequence[Alternative]]  # of each test, best first


def _compared(
    problem: Problem, state: State, history: Sequence[State], settings: Settings, progress: Progress
) -> _Compared:
    progress("looking for what the library does not explain")
    # before the drop-one tests: the equation sets the best prediction against which the gap is measured
    # beside effects that were not tried it would stand for one of them
    left = explore(problem, state, settings) if settings.open_ended and not settings.over() else OpenEnded()
    tests = drop_one_tests(problem, state, _on_the_way(history), left, settings)
    return _Compared(
        state, left, tests, [alternatives_of(problem, state, test, settings, progress) for test in tests]
    )


def _on_the_way(history: Sequence[State]) -> dict[frozenset[str], Values]:
    """Values of the search by accepted effects."""
    return {frozenset(h.accepted): h.fit.values for h in history}


def nothing_usable(model: str, recordings: Sequence[str], error: Unusable) -> f.Findings:
    """The verdict on recordings that cannot be used at all."""
    return f.Findings(
        model=model,
        recordings=list(recordings),
        status="inconclusive",
        reasons=error.reasons,
        complaints=list(error.complaints),
    )


def alternatives_of(
    problem: Problem,
    state: State,
    test: DropOneTest,
    settings: Settings,
    progress: Progress = lambda _: None,
) -> list[Alternative]:
    """What explains the recordings as well as an accepted effect in its place, best first."""
    others = tuple(n for n in state.accepted if n != test.effect)
    active = active_interval_of(problem.model.effect(test.effect), state.fit.values)
    scores, starts = _rivals(problem, state, others, test.without, active, settings)
    return alternatives(problem, state, test.effect, test.without, scores, starts, settings, progress)


def _finding(
    problem: Problem,
    state: State,
    baseline: State,
    test: DropOneTest,
    rivals: Sequence[Alternative],
    caveats: list[str],
) -> f.Finding:
    """One finding; rivals: it and its group, best first."""
    best, *rest = rivals
    effect = problem.model.effect(best.effect)
    separations = [separation(problem, state.noise, best, other) for other in rest]
    return f.Finding(
        effect=effect.name,
        named=not caveats,
        caveats=caveats,
        kind=effect.kind,
        place=effect.place,
        sentence=effect.said(best.fit.values.shared[effect.parameters[0].name]),
        equation=effect.equation,
        parameters=summary.estimates(problem, effect, best.fit, state.noise),
        sse_reduction=test.sse_reduction,
        threshold=test.threshold,
        held_out_sse_reduction=test.held_out_sse_reduction,
        gap_closed=test.gap_closed,
        confounded_share=_confounded(baseline, effect),
        held_out_error=test.error_ratio,
        group=[_member(problem, state, best, other) for other in rest],
        separate_by=[s for s in separations if s is not None],
        where=locate(
            problem, state.noise, test.without, best.fit, active_interval_of(effect, best.fit.values)
        ),
    )


def _confounded(baseline: State, effect: Effect) -> float:
    """The share of an effect that nuisances can do."""
    return next((s.confounded_share for s in baseline.scores if s.effect == effect.name), 0.0)


def _member(problem: Problem, state: State, best: Alternative, other: Alternative) -> f.GroupMember:
    """An alternative beside the best one, from which its likelihood differs by 0 or more."""
    return f.GroupMember(
        effect=other.effect,
        likelihood_difference=other.difference - best.difference,
        collinearity=other.collinearity,
        parameters=summary.estimates(problem, problem.model.effect(other.effect), other.fit, state.noise),
    )


def _rivals(
    problem: Problem,
    state: State,
    others: tuple[str, ...],
    without: Fit,
    active: Windows | None,
    settings: Settings,
) -> tuple[list[Score], Starts]:
    """Scores of the library with one accepted effect taken out again, and where fits of it begin.

    active: the windows in which that effect acted, None for all.
    """
    base = problem.predict(without.values)
    rest = [e for e in problem.model.effects if e.name not in others]
    columns = sensitivities(problem, without.values, base, rest, cached=True)
    if active is not None:
        columns = restricted_to(problem, columns, active)
    scores = screen(problem, state.noise, without, columns, settings)
    return scores, Starts(problem, state.noise, without, columns)
