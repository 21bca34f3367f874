"""Forward selection: screen, shortlist, non-linear refit, penalty, held-out gate; noise re-estimated every round.

Nothing here decides on names: gates that need the floor, the groups and the words come after (discrepancy.judge).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from discrepancy.fit import Fit, Mask, fit, held_out
from discrepancy.model import Effect
from discrepancy.noise import Noise, estimate_noise, white_noise
from discrepancy.problem import Problem, Values
from discrepancy.recording import Array
from discrepancy.screen import (
    Columns,
    Projector,
    Score,
    active,
    by_statistic,
    penalty,
    projected,
    score,
    sensitivities,
    spread,
    stretches,
    switches,
    time_blocks,
)
from discrepancy.spells import for_a_while, price, settle, spell_of, within
from discrepancy.starts import Starts
from discrepancy.unexplained import unexplained

Progress = Callable[[str], None]
BEHIND = 0.25  # share of the largest gain in SSE below which a begun refit is left, where that gain is
REACH = 0.5  # share of the gain that is needed, below which a begun refit of a costly model is left
CLEAR = 100.0  # beyond doubt: another round comes, in which it may be tried again
SURE = 1.96  # standard deviations
STRAINED = 3.0  # standard deviations of its prior beyond which a nuisance stands in for something else


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """How strict to be. alpha: chance of a false finding in a search; held_out: least gain in SSE on data not fitted;
    confirmed: and least share of the gain on fitted data; same: likelihood difference (in SSE) that cannot be told apart.
    """

    alpha: float = 0.02
    held_out: float = 4.0
    confirmed: float = 0.3
    same: float = 6.0
    gap_closed: float = 0.5
    shortlist: int = 6
    most_effects: int = 6
    folds: int = 2
    open_ended: bool = True


@dataclass(frozen=True, slots=True)
class Trial:
    """One effect added to the nuisances and accepted effects: refitted, tested, confirmed or not."""

    effect: str
    fit: Fit
    gain: float  # in SSE, all data, over inflation
    plain: float  # the same not divided
    needed: float
    held_out_gain: float | None = None  # summed over folds; only put to the test if gain > needed
    inflation: float = 1.0
    size: float = np.inf  # what its largest switch surely is, in typical changes
    explained: float = (
        1.0  # share of the squared errors of the channel it helps most that it takes away, held out
    )
    beside: "State | None" = (
        None  # the fit without it, under the noise left beside it, where that is not that of the search
    )

    @property
    def lead(self) -> float:
        """Gain in SSE itself, beyond what is needed: which effect explains best, once it is sure that it explains something."""
        return self.plain - self.needed

    def accepted(self, settings: Settings) -> bool:
        confirmed = max(settings.held_out, settings.confirmed * self.gain)
        return self.held_out_gain is not None and self.held_out_gain > confirmed

    def negligible(self, problem: Problem) -> bool:
        """Whether it is too small to matter, however significant."""
        return self.size < problem.model.negligible or self.explained < problem.model.least_explained


@dataclass(frozen=True, slots=True)
class State:
    """Where a search stands: noise, the fit with the accepted effects, the screen of the others, and what was tried.

    passing: effects that may act for a while only, best first; unstrained: the fit with nuisances put back to their priors, where the data had pushed one far from it.
    """

    noise: Noise
    fit: Fit
    accepted: tuple[str, ...]
    scores: tuple[Score, ...]
    trials: tuple[Trial, ...] = ()
    columns: tuple[Columns, ...] = field(default=(), repr=False)
    passing: tuple[tuple[Score, range], ...] = ()
    unstrained: Values | None = None


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
        found = _passed(problem, state, settings) or together(problem, state, settings)
        if not found:
            return state, history
        progress(" and ".join(f"{t.effect}: gain {t.gain:.0f} ({t.needed:.0f} needed)" for t in found))
        accepted, values = (*accepted, *(t.effect for t in found)), found[-1].fit.values


def _passed(problem: Problem, state: State, settings: Settings) -> list[Trial]:
    """The best trial that passed, if any."""
    passed = [t for t in state.trials if t.accepted(settings) and not t.negligible(problem)]
    return [_first(problem, passed)] if passed else []


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
    other = next(iter(_passed(problem, given, settings)), None)
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


def _first(problem: Problem, passed: Sequence[Trial]) -> Trial:
    """The effect that explains best: by lead, or by likelihood where some were judged under the noise that they leave."""
    if not any(t.beside for t in passed):
        return max(passed, key=lambda t: t.lead)
    return max(passed, key=lambda t: _log_likelihood(problem, t) - t.needed)


def _log_likelihood(problem: Problem, trial: Trial) -> float:
    """Twice the logarithm of the likelihood of a trial under the noise that it leaves, but for a constant."""
    raw = problem.measured - problem.predict(trial.fit.values)
    noise = estimate_noise(problem, raw, len(trial.fit.names))
    density = sum(
        b.shape[0] * float(np.linalg.slogdet(noise.whiteners[b.group].inverse_factor)[1])
        for b in problem.blocks
    )
    return 2.0 * density - float(np.sum(noise.whiten(raw) ** 2))


def free_names(problem: Problem, effects: Sequence[str]) -> tuple[str, ...]:
    """Shared parameters fitted with these effects on."""
    return problem.nuisance_names + tuple(n for name in effects for n in problem.model.effect(name).names)


def assess(problem: Problem, accepted: tuple[str, ...], values: Values, settings: Settings) -> State:
    """Noise with all candidates projected out, the fit under it, and the screen of what is not accepted."""
    names = free_names(problem, accepted)
    candidates = [e for e in problem.model.effects if e.name not in accepted]
    noise = white_noise(problem, problem.measured - problem.predict(values))
    fitted = fit(problem, noise, names, values, rough=True)
    at = values if problem.model.costly else fitted.values
    for _ in range(2):
        problem.settle(fitted.values)
        base = problem.predict(fitted.values)
        columns = sensitivities(problem, at, problem.predict(at), candidates)
        raw = problem.measured - base
        noise = estimate_noise(problem, *unexplained(problem, noise, fitted, raw, columns))
        fitted = fit(problem, noise, names, fitted.values)
        at = fitted.values
    scores = screen(problem, noise, fitted, columns, settings)
    passing = for_a_while(problem, noise, fitted, scores, columns, settings.alpha)
    unstrained = _unstrained(problem, fitted)
    if unstrained is not None:
        scores = _better(scores, _screen_at(problem, noise, names, unstrained, candidates, settings))
    return State(noise, fitted, accepted, tuple(scores), (), tuple(columns), tuple(passing), unstrained)


def _unstrained(problem: Problem, fitted: Fit) -> Values | None:
    """Nuisances back at their priors if one of them is far from its own: it may stand in for an effect that is seen from there only."""
    known = [p for p in problem.model.nuisances if p.scope == "all" and p.prior_sd is not None]
    shared = fitted.values.shared
    if all(abs(shared[p.name] - p.value) <= STRAINED * (p.prior_sd or np.inf) for p in known):
        return None
    return fitted.values.with_shared({p.name: p.value for p in known})


def _screen_at(
    problem: Problem,
    noise: Noise,
    names: Sequence[str],
    values: Values,
    candidates: Sequence[Effect],
    settings: Settings,
) -> list[Score]:
    point, base = fit(problem, noise, names, values, iterations=0), problem.predict(values)
    columns = sensitivities(problem, values, base, candidates)
    return screen(problem, noise, point, columns, settings)


def _better(one: Sequence[Score], other: Sequence[Score]) -> list[Score]:
    """Each effect's higher score, best first."""
    by_name = {s.effect: s for s in other}
    return by_statistic([max(s, by_name[s.effect], key=lambda x: x.statistic) for s in one])


def screen(
    problem: Problem, noise: Noise, fitted: Fit, columns: Sequence[Columns], settings: Settings
) -> list[Score]:
    """Scores of all candidates, best first."""
    projector, blocks = Projector(problem, noise, fitted), stretches(noise)
    needed = [penalty(len(active(c.effect)), len(columns), settings.alpha) for c in columns]
    return by_statistic(
        [
            score(c, seen, fitted.residual, critical, blocks)
            for c, seen, critical in zip(columns, projected(noise, projector, columns), needed, strict=True)
        ]
    )


def shortlisted(model_effects: Sequence[Effect], scores: Sequence[Score], settings: Settings) -> list[Score]:
    """The best by score, and the partner of every lag or delay among them: their first-order scores are the same."""
    half = settings.shortlist // 2
    sure = list(scores[:half])
    # a doubtful noise estimate must not keep an effect from being tried: the best before inflation come too
    loud = sorted((s for s in scores[half:]), key=lambda s: -s.statistic * s.inflation)[
        : settings.shortlist - half
    ]
    best = [s for s in sure + loud if s.statistic * s.inflation > 3.0]
    named = {s.effect for s in best}
    partners = {
        swapped
        for name in named
        for swapped in (name.replace(" lag", " delay"), name.replace(" delay", " lag"))
        if swapped not in named
    }
    return best + [s for s in scores if s.effect in partners]


def try_shortlist(problem: Problem, state: State, settings: Settings) -> list[Trial]:
    """Refit the shortlist; put those that gain enough to the held-out test."""
    listed = shortlisted(problem.model.effects, state.scores, settings)
    passing = state.passing[: settings.shortlist // 2]
    # what seems to act for a while may act always
    named = {s.effect for s in listed}
    listed += [s for s, _ in passing if s.effect not in named]
    tried: list[tuple[Score, range | None]] = [*((s, None) for s in listed), *passing]
    points = Starts(problem, state.noise, state.fit, state.columns, state.unstrained)
    begins = [(s, windows, points.of(s, windows)) for s, windows in tried]
    most = max((start[0][1] for *_, start in begins), default=0.0)
    # of costly models: what is far behind by its score and where it starts has its turn when what is beyond doubt has been taken in
    least = BEHIND * most if most > CLEAR and problem.model.costly else -np.inf
    begins = [b for b in begins if max(b[0].statistic * b[0].inflation, b[2][0][1]) > least]
    begun = [begin(problem, state, s, start) for s, _, start in begins]
    most = max((state.fit.sse - b[0].sse for b in begun), default=0.0)
    least = BEHIND * most if most > CLEAR else -np.inf
    trials = [
        refit(problem, state, s, b, settings, least, windows)
        for (s, windows, _), b in zip(begins, begun, strict=True)
    ]
    trials += _in_the_same_windows(problem, state, trials, points, settings)
    sure = [t.gain > t.needed and t.size >= problem.model.negligible for t in trials]
    best = max((t.lead for t, fine in zip(trials, sure, strict=True) if fine and not t.beside), default=0.0)
    return [
        confirm(problem, t.beside or state, t, settings)
        if fine and (t.beside or t.lead > best - 3.0 * settings.same)
        else t
        for t, fine in zip(trials, sure, strict=True)
    ]


def _in_the_same_windows(
    problem: Problem, state: State, trials: Sequence[Trial], points: Starts, settings: Settings
) -> list[Trial]:
    """Rivals of the best effect that acts for a while: the likeliest others in its windows, under the noise left beside it."""
    brief = [t for t in trials if t.beside and t.gain > t.needed]
    if not brief:
        return []
    best = max(brief, key=lambda t: t.gain)
    windows = spell_of(problem.model.effect(best.effect), best.fit.values)
    assert windows is not None
    assert best.beside is not None
    tried = {t.effect for t in trials if t.beside}
    others = [c for c in state.columns if c.effect.size == 1 and c.effect.name not in tried]
    scores = screen(problem, best.beside.noise, best.beside.fit, within(problem, others, windows), settings)
    likely = [s for s in scores if s.statistic > best.needed][: settings.shortlist // 2]
    return [
        refit(problem, state, s, begin(problem, state, s, points.of(s, windows)), settings, -np.inf, windows)
        for s in likely
    ]


def begin(problem: Problem, state: State, found: Score, points: Sequence[tuple[Values, float]]) -> list[Fit]:
    """The first steps of a refit with one more effect from each of its starts, best first."""
    names = free_names(problem, (*state.accepted, found.effect))
    fits = [fit(problem, state.noise, names, point, iterations=2, rough=True) for point, _ in points]
    return sorted(fits, key=lambda f: f.sse)


def refit(
    problem: Problem,
    state: State,
    found: Score,
    begun: Sequence[Fit],
    settings: Settings,
    least: float,
    windows: range | None,
) -> Trial:
    """Non-linear refit with one more effect, brought to its end if its beginnings gained at least `least`; windows: as in `begin`."""
    effect, names, best = problem.model.effect(found.effect), begun[0].names, begun[0]
    if problem.model.costly:
        least = max(least, REACH * price(problem, effect, best.values, settings.alpha))
    if state.fit.sse - best.sse > least:
        fits = [fit(problem, state.noise, names, b.values, iterations=4) for b in begun]
        best = min(fits, key=lambda f: f.sse)
    if windows is None:
        return weighed(problem, state, effect, best, settings)
    names = free_names(problem, state.accepted)
    own = settle(problem, state.noise, effect, names, best.values, windows, state.columns)
    alike = own.even(settings.alpha / len(problem.model.effects))
    beside = replace(state, noise=own.noise, fit=own.without)
    size = size_of(effect, own.with_it)
    needed = price(problem, effect, best.values, settings.alpha)
    gain = own.sure_gain if alike else 0.0  # what comes and goes in between is another thing
    return Trial(effect.name, own.with_it, gain, own.gain, needed, None, own.inflation, size, beside=beside)


def weighed(problem: Problem, state: State, effect: Effect, fitted: Fit, settings: Settings) -> Trial:
    """What a fit with one effect more than the state's gains, and what it would have to."""
    plain, inflation = state.fit.sse - fitted.sse, spread(fitted, active(effect), stretches(state.noise))
    needed = price(problem, effect, fitted.values, settings.alpha)
    size = size_of(effect, fitted)
    return Trial(effect.name, fitted, plain / inflation, plain, needed, None, inflation, size)


def size_of(effect: Effect, fitted: Fit) -> float:
    """What the largest of an effect's switches surely is, in typical changes: to the near end of its 95 % interval."""
    return max(
        max(abs(fitted.values.shared[p.name] - p.value) - SURE * fitted.sd(p.name), 0.0) / abs(p.typical)
        for p in switches(effect)
    )


def project_out(fitted: Fit, kept: Sequence[int]) -> Array:
    """Columns `kept` of a fit, orthogonal to its other columns."""
    others = [i for i in range(len(fitted.names)) if i not in kept]
    X, J = fitted.columns[:, list(kept)], fitted.columns[:, others]
    if not others:
        return X
    return X - J @ np.linalg.lstsq(J, X, rcond=None)[0]


def folds(problem: Problem, noise: Noise, count: int) -> list[Mask]:
    """Rows held out in turn: every count-th window, or stretches of time where windows are few."""
    number: NDArray[np.intp] = noise.row_window
    if problem.model.held_out_s is not None:
        number = (noise.row_time // problem.model.held_out_s).astype(np.intp)
    elif len(problem.windows) < 2 * count:
        number = time_blocks(noise, 4 * count) if len(problem.windows) < count else number
    return [number % count == i for i in range(count)]


def confirm(problem: Problem, state: State, trial: Trial, settings: Settings) -> Trial:
    """The trial with its gain in SSE on held-out rows, summed over the folds: everything shared is fitted on the other rows."""
    noise, count = state.noise, len(problem.channels)
    before = held_out_residual(problem, noise, state.accepted, state.fit.values, settings) ** 2
    after = (
        held_out_residual(problem, noise, (*state.accepted, trial.effect), trial.fit.values, settings) ** 2
    )
    whole = np.bincount(noise.row_channel, before, count)
    taken = np.bincount(noise.row_channel, before - after, count) / np.maximum(whole, 1e-300)
    return replace(trial, held_out_gain=float(np.sum(before - after)), explained=float(np.max(taken)))


def held_out_residual(
    problem: Problem, noise: Noise, effects: Sequence[str], start: Values, settings: Settings
) -> Array:
    """Whitened residual (n,), every row from a fit of the shared parameters that has not seen it."""
    names, residual = free_names(problem, effects), np.empty(noise.keep.size)
    for test in folds(problem, noise, settings.folds):
        trained = fit(problem, noise, names, start, rows=~test, iterations=4, rough=True)
        residual[test] = held_out(problem, noise, trained.values, test)[test]
    return residual
