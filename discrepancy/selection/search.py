"""The search: forward selection by screen, shortlist, candidate fits, threshold and held-out gate, with new noise in every round.

The search does not name causes. Gates that need the open-ended equation and the groups follow in discrepancy.decision.judge.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from discrepancy import gates
from discrepancy.estimation.fit import Fit, fit, log_likelihood
from discrepancy.estimation.noise import Noise
from discrepancy.estimation.problem import Problem, Values
from discrepancy.estimation.set_aside import NOTHING, SetAside
from discrepancy.selection.assess import assess
from discrepancy.selection.candidate_fits import candidate_fit, confirm, project_out, try_shortlist
from discrepancy.selection.riddles import to_set_aside
from discrepancy.selection.screen import spread, time_blocks_of
from discrepancy.selection.state import CandidateFit, Progress, Settings, State, free_names, switched_off


def search(
    problem: Problem,
    settings: Settings,
    progress: Progress = lambda _: None,
    look: Callable[[Noise, Fit], None] | None = None,
) -> tuple[State, list[State]]:
    """The final state, and the states on the way (the first is the baseline). look: gets the baseline's first fit, as of `assess`.

    Readings that nothing explains at the end, and on request intervals of time, are set aside, and all is looked for again without them. A
    recording without such rows is searched once; so is one in which intervals left out would let in an effect that was not accepted with them.
    """
    state, history = _search(problem, settings, progress, NOTHING, look)
    whole = settings.set_aside == "intervals"
    aside = NOTHING if settings.set_aside == "nothing" else to_set_aside(problem, state, with_intervals=whole)
    if not aside.intervals or settings.over():
        return state, history
    progress(
        f"{sum(s.rows for s in aside.intervals)} rows that nothing explains are set aside; searching again"
    )
    again, steps = _search(problem, settings, progress, aside)
    # An effect that passes only without an interval that contradicts it has not passed: the interval may be the evidence against it. A
    # single wrong reading is evidence of nothing: no machine moves there and back between two samples.
    if whole and set(again.accepted) - set(state.accepted):
        return state, history
    return again, steps


def searched_on(
    problem: Problem,
    state: State,
    settings: Settings,
    progress: Progress,
    found: Sequence[CandidateFit] = (),
) -> tuple[State, list[State]]:
    """The same from a state of another search on: with its effects and those found since, and with what it has set aside."""
    values = found[-1].fit.values if found else state.fit.values
    begin = (*state.accepted, *(t.effect for t in found)), values
    return _search(problem, settings, progress, state.aside, begin=begin)


def _search(
    problem: Problem,
    settings: Settings,
    progress: Progress,
    aside: SetAside,
    look: Callable[[Noise, Fit], None] | None = None,
    begin: tuple[tuple[str, ...], Values] | None = None,
) -> tuple[State, list[State]]:
    """One search; aside, look: of `assess`, the latter for the baseline; begin: effects and values at the start, else the baseline's."""
    history: list[State] = []
    accepted, values = begin or ((), problem.start())
    while True:
        state = assess(problem, accepted, values, settings, aside, None if accepted else look)
        if len(accepted) < settings.most_effects:
            progress(f"{len(state.scores)} effects screened, {problem.simulations} simulations")
            state = replace(state, trials=tuple(try_shortlist(problem, state, settings)))
        history.append(state)
        aside = state.aside
        if over_budget(problem, settings) or settings.over():
            return state, history
        found = best_confirmed(problem, state, settings) or confirmed_pair(problem, state, settings)
        if not found:
            return state, history
        progress(
            " and ".join(
                f"{t.effect}: evidence {t.sse_reduction:.0f} (threshold {t.threshold:.0f})" for t in found
            )
        )
        accepted, values = (*accepted, *(t.effect for t in found)), found[-1].fit.values


def over_budget(problem: Problem, settings: Settings) -> bool:
    """Whether the search has used its budget of simulations; a model that is far from the recordings would be fitted for hours."""
    return problem.costs.costly and problem.simulations > settings.most_simulations


def best_confirmed(problem: Problem, state: State, settings: Settings) -> list[CandidateFit]:
    """The best candidate that held-out data confirm, if any."""
    good = [t for t in state.trials if t.accepted(settings) and not t.negligible(problem)]
    return [_best(problem, state.noise, good)] if good else []


def confirmed_pair(problem: Problem, state: State, settings: Settings) -> list[CandidateFit]:
    """Two effects that pass together though neither passes alone; or the one of them that makes the other unnecessary; or nothing."""
    # A second missing effect makes the blocks of time disagree about the first one, so that its variance inflation is large and it
    # fails alone. Only an effect with a clear reduction is tried again, and only beside another one that then passes; with both in
    # the model the blocks have to agree.
    inconsistent = [
        t
        for t in state.trials
        if t.raw_sse_reduction > max(t.threshold, gates.CLEAR.threshold) and not t.reference
    ]
    if not inconsistent or len(state.accepted) + 2 > settings.most_effects:
        return []
    one = max(inconsistent, key=lambda t: t.margin)
    given = assess(problem, (*state.accepted, one.effect), one.fit.values, settings, state.aside)
    given = replace(given, trials=tuple(try_shortlist(problem, given, settings)))
    other = next(iter(best_confirmed(problem, given, settings)), None)
    if other is None:
        return []
    effect = problem.model.effect(one.effect)
    noise = (other.reference or given).noise
    # does the first effect pass beside the second one, compared with the second one alone?
    accepted = (*state.accepted, other.effect)
    off = other.fit.values.with_shared(switched_off(effect))
    without = fit(problem, noise, free_names(problem, accepted), off)
    alone = replace(given, noise=noise, fit=without, accepted=accepted)
    again = candidate_fit(problem, alone, effect, other.fit, settings)
    if not again.passes:
        # it does not: the second effect may have been hidden by the first, and be sufficient alone
        last = problem.model.effect(other.effect)
        seen = fit(problem, state.noise, without.names, without.values)
        solo = candidate_fit(problem, state, last, seen, settings)
        return _confirmed(problem, state, solo, settings) if solo.passes else []
    if not all(
        _blocks_agree(problem, noise, other.fit, name, settings) for name in (one.effect, other.effect)
    ):
        return []
    stands = _confirmed(problem, alone, again, settings)
    return [*stands, other] if stands else []


def _confirmed(problem: Problem, state: State, trial: CandidateFit, settings: Settings) -> list[CandidateFit]:
    """The candidate with its reduction on held-out rows, if they confirm it; else an empty list."""
    tried = confirm(problem, state, trial, settings)
    return [tried] if tried.accepted(settings) and not tried.negligible(problem) else []


def _blocks_agree(problem: Problem, noise: Noise, fitted: Fit, name: str, settings: Settings) -> bool:
    """Whether the blocks of time in which an effect shows agree on its size, within chance."""
    # The variance inflation times the degrees of freedom is chi-square if the blocks agree. Blocks without the effect add none: the
    # effective number of blocks is (sum of powers)² / sum of squared powers.
    names, blocks = problem.model.effect(name).amplitude_names, time_blocks_of(noise)
    direction = project_out(fitted, [fitted.names.index(n) for n in names])
    power = np.bincount(blocks, np.sum(direction**2, axis=1))
    freedom = max(float(np.sum(power)) ** 2 / float(np.sum(power**2)) - 1.0, 1.0)
    beyond = float(chi2.sf(spread(fitted, names, blocks) * freedom, freedom))
    return beyond > settings.alpha / len(problem.model.effects)


def _best(problem: Problem, noise: Noise, good: list[CandidateFit]) -> CandidateFit:
    """The best candidate: by margin, or by likelihood where some were judged under another noise, since their SSE are not comparable."""
    if not any(t.reference for t in good):
        return max(good, key=lambda t: t.margin)
    return max(good, key=lambda t: log_likelihood(problem, noise, t.fit) - t.threshold)
