"""Forward selection: screen, shortlist, non-linear refit, penalty, held-out gate; noise re-estimated every round.

Nothing here decides on names: gates that need the floor, the groups and the words come after (discrepancy.judge).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from discrepancy.assess import assess
from discrepancy.fit import Fit, fit
from discrepancy.noise import Noise, estimate_noise
from discrepancy.problem import Problem
from discrepancy.screen import active, spread, stretches
from discrepancy.state import CLEAR, Progress, Settings, State, Trial, free_names
from discrepancy.trials import confirm, project_out, try_shortlist, weighed


def search(
    problem: Problem, settings: Settings, progress: Progress = lambda _: None
) -> tuple[State, list[State]]:
    """The final state, and the states on the way (the first is the baseline)."""
    history: list[State] = []
    accepted: tuple[str, ...] = ()
    values = problem.start()
    while True:
        state = assess(problem, accepted, values, settings)
        if len(accepted) < settings.most_effects:
            progress(f"{len(state.scores)} effects screened, {problem.simulations} simulations")
            state = replace(state, trials=tuple(try_shortlist(problem, state, settings)))
        history.append(state)
        if cut_short(problem, settings):
            return state, history
        found = passed(problem, state, settings) or together(problem, state, settings)
        if not found:
            return state, history
        progress(" and ".join(f"{t.effect}: gain {t.gain:.0f} ({t.needed:.0f} needed)" for t in found))
        accepted, values = (*accepted, *(t.effect for t in found)), found[-1].fit.values


def cut_short(problem: Problem, settings: Settings) -> bool:
    """Whether the search has cost as much as it may: a model that is wrong by far is fitted again and again to what it cannot do."""
    return problem.model.costly and problem.simulations > settings.most_simulations


def passed(problem: Problem, state: State, settings: Settings) -> list[Trial]:
    """The best trial that passed, if any."""
    good = [t for t in state.trials if t.accepted(settings) and not t.negligible(problem)]
    return [_first(problem, state.noise, good)] if good else []


def together(problem: Problem, state: State, settings: Settings) -> list[Trial]:
    """Two effects of which each passes beside the other, though neither by itself; or the one that was seen only beside another that it makes
    needless; none if there are none.

    What is left out besides makes the stretches of a recording disagree about either of them: with both they have to agree. Only an effect
    that takes away more than chance can is taken up again, and only together with what then passes.
    """
    doubted = [t for t in state.trials if t.plain > max(t.needed, CLEAR) and t.beside is None]
    if not doubted or len(state.accepted) + 2 > settings.most_effects:
        return []
    one = max(doubted, key=lambda t: t.lead)
    given = assess(problem, (*state.accepted, one.effect), one.fit.values, settings)
    given = replace(given, trials=tuple(try_shortlist(problem, given, settings)))
    other = next(iter(passed(problem, given, settings)), None)
    if other is None:
        return []
    effect = problem.model.effect(one.effect)
    beside = (other.beside or given).noise
    accepted = (*state.accepted, other.effect)
    off = {p.name: p.value for p in effect.parameters}
    without = fit(problem, beside, free_names(problem, accepted), other.fit.values.with_shared(off))
    alone = replace(given, noise=beside, fit=without, accepted=accepted)
    again = weighed(problem, alone, effect, other.fit, settings)
    if again.gain <= again.needed:
        last = problem.model.effect(other.effect)
        seen = fit(problem, state.noise, without.names, without.values)
        solo = weighed(problem, state, last, seen, settings)
        return _stands(problem, state, solo, settings) if solo.gain > solo.needed else []
    if not all(_agreed(problem, beside, other.fit, name, settings) for name in (one.effect, other.effect)):
        return []
    stands = _stands(problem, alone, again, settings)
    return [*stands, other] if stands else []


def _stands(problem: Problem, state: State, trial: Trial, settings: Settings) -> list[Trial]:
    """The trial with its gain on held-out rows if that confirms it, else nothing."""
    tried = confirm(problem, state, trial, settings)
    return [tried] if tried.accepted(settings) and not tried.negligible(problem) else []


def _agreed(problem: Problem, noise: Noise, fitted: Fit, name: str, settings: Settings) -> bool:
    """Whether the stretches of time in which an effect shows agree on it, but for chance."""
    names, blocks = active(problem.model.effect(name)), stretches(noise)
    direction = project_out(fitted, [fitted.names.index(n) for n in names])
    power = np.bincount(blocks, np.sum(direction**2, axis=1))
    freedom = max(float(np.sum(power)) ** 2 / float(np.sum(power**2)) - 1.0, 1.0)
    beyond = float(chi2.sf(spread(fitted, names, blocks) * freedom, freedom))
    return beyond > settings.alpha / len(problem.model.effects)


def _first(problem: Problem, noise: Noise, good: Sequence[Trial]) -> Trial:
    """The effect that explains best: by lead, or by likelihood where some were judged under the noise that they leave."""
    if not any(t.beside for t in good):
        return max(good, key=lambda t: t.lead)
    return max(good, key=lambda t: _log_likelihood(problem, noise, t) - t.needed)


def _log_likelihood(problem: Problem, noise: Noise, trial: Trial) -> float:
    """Twice the logarithm of the likelihood of a trial under the noise that it leaves, but for a constant; noise: that of the search."""
    raw = problem.measured - problem.predict(trial.fit.values)
    noise = estimate_noise(problem, raw, len(trial.fit.names), noise)
    return 2.0 * noise.log_density() - float(np.sum(noise.whiten(raw) ** 2))
