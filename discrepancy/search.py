"""Forward selection: screen, shortlist, non-linear refit, penalty, held-out gate; noise re-estimated every round.

Nothing here decides on names: gates that need the floor, the groups and the words come after (discrepancy.judge).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2
from scipy.stats import f as student_squared

from discrepancy.fit import Fit, Mask, WindowStates, differences, fit, held_out
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
    inflation_of,
    penalty,
    projected,
    score,
    sensitivities,
    spread,
    stretches,
    switches,
    time_blocks,
)
from discrepancy.spells import best_spell, price, runs, searched

Progress = Callable[[str], None]
BEHIND = 0.25  # share of the largest gain in SSE below which a begun refit is left, where that gain is
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

    unstrained: the fit with nuisances put back to their priors, where the data had pushed one far from it.
    """

    noise: Noise
    fit: Fit
    accepted: tuple[str, ...]
    scores: tuple[Score, ...]
    trials: tuple[Trial, ...] = ()
    columns: tuple[Columns, ...] = field(default=(), repr=False)
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
        passed = [t for t in state.trials if t.accepted(settings) and not t.negligible(problem)]
        if not passed:
            return state, history
        best = max(passed, key=lambda t: t.lead)
        progress(f"{best.effect}: gain {best.gain:.0f} ({best.needed:.0f} needed)")
        accepted, values = (*accepted, best.effect), best.fit.values


def free_names(problem: Problem, effects: Sequence[str]) -> tuple[str, ...]:
    """Shared parameters fitted with these effects on."""
    return problem.nuisance_names + tuple(n for name in effects for n in problem.model.effect(name).names)


def assess(problem: Problem, accepted: tuple[str, ...], values: Values, settings: Settings) -> State:
    """Noise with all candidates projected out, the fit under it, and the screen of what is not accepted."""
    names = free_names(problem, accepted)
    candidates = [e for e in problem.model.effects if e.name not in accepted]
    noise = white_noise(problem, problem.measured - problem.predict(values))
    fitted = fit(problem, noise, names, values)
    columns: list[Columns] = []
    for _ in range(2):
        base = problem.predict(fitted.values)
        columns = sensitivities(problem, fitted.values, base, candidates)
        raw = problem.measured - base
        noise = estimate_noise(problem, *_unexplained(problem, noise, fitted, raw, columns))
        fitted = fit(problem, noise, names, fitted.values)
    scores = screen(problem, noise, fitted, columns, settings)
    unstrained = _unstrained(problem, fitted)
    if unstrained is not None:
        scores = _better(scores, _screen_at(problem, noise, names, unstrained, candidates, settings))
    return State(noise, fitted, accepted, tuple(scores), (), tuple(columns), unstrained)


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


def _unexplained(
    problem: Problem, noise: Noise, fitted: Fit, raw: Array, columns: Sequence[Columns]
) -> tuple[Array, float]:
    """Raw residual with every candidate projected out, and how many parameters that took.

    Each candidate enters at each probe in units of that change, with a prior of a few such changes, so that a large
    library cannot eat a short recording.
    """
    all_columns = np.concatenate(
        [part for c in columns for part in c.raw] or [np.zeros((raw.size, 0))], axis=1
    )
    projector = Projector(problem, noise, fitted)
    X = projector.off(noise.whiten(all_columns))
    gram = X.T @ X
    weak = gram + np.eye(len(gram)) / 5.0**2
    coefficient = np.linalg.solve(weak, X.T @ fitted.residual) if len(gram) else np.zeros(0)
    used = float(np.trace(np.linalg.solve(weak, gram))) if len(gram) else 0.0
    left = raw - all_columns @ coefficient
    # nuisances and initial states give way too
    return _refitted(problem, noise, fitted, left), used + projector.states.used + len(fitted.names)


def _refitted(problem: Problem, noise: Noise, fitted: Fit, left: Array) -> Array:
    base = problem.predict(fitted.values)
    raw = differences(problem, fitted.values, base, [*fitted.names, *problem.local_names])
    J, L = raw[:, : len(fitted.names)], raw[:, len(fitted.names) :]
    white = noise.whiten(left)
    everything = np.ones(white.size, bool)
    white_J, white_L = noise.whiten(J), noise.whiten(L)
    states = WindowStates(white_L, noise.row_window, everything)
    shared = fitted.covariance @ (fitted.columns.T @ states.off(white))
    local = states.solve(white - white_J @ shared, len(problem.windows), noise.row_window)
    return np.asarray(left - J @ shared - np.sum(L * local[problem.row_window], axis=1), float)


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
    passing = for_a_while(problem, state, settings)
    # what seems to act for a while may act always
    named = {s.effect for s in listed}
    listed += [s for s, _ in passing if s.effect not in named]
    tried: list[tuple[Score, range | None]] = [*((s, None) for s in listed), *passing]
    begun = [begin(problem, state, s, windows) for s, windows in tried]
    most = max((state.fit.sse - b[0].sse for b in begun), default=0.0)
    least = BEHIND * most if most > CLEAR else -np.inf
    trials = [
        refit(problem, state, s, b, settings, least, windows)
        for (s, windows), b in zip(tried, begun, strict=True)
    ]
    sure = [t.gain > t.needed and t.size >= problem.model.negligible for t in trials]
    best = max((t.lead for t, fine in zip(trials, sure, strict=True) if fine), default=0.0)
    return [
        confirm(problem, state, t, settings) if fine and t.lead > best - 3.0 * settings.same else t
        for t, fine in zip(trials, sure, strict=True)
    ]


def for_a_while(problem: Problem, state: State, settings: Settings) -> list[tuple[Score, range]]:
    """The effects that score better in some run of windows than in all, as far as the choice of the run allows; best first."""
    among = runs(problem)
    if not among:
        return []
    projector, found = Projector(problem, state.noise, state.fit), []
    allowed = penalty(1, len(problem.model.effects), settings.alpha) + searched(among)
    for columns in [c for c in state.columns if c.effect.size == 1]:
        score = next(s for s in state.scores if s.effect == columns.effect.name)
        spell = best_spell(state.noise, projector, state.fit.residual, columns.raw[score.probe][:, 0], among)
        if spell and spell.statistic > score.statistic * score.inflation + allowed:
            change = spell.size * columns.changes[score.probe]
            found.append((spell.statistic, replace(score, change=change), spell.windows))
    return [(s, windows) for _, s, windows in sorted(found, key=lambda f: -f[0])[: settings.shortlist // 2]]


def begin(problem: Problem, state: State, found: Score, windows: range | None) -> list[Fit]:
    """The first steps of a refit with one more effect, from the expected change and from the probe, best first; windows: in which
    it acts, all if None.
    """
    effect = problem.model.effect(found.effect)
    names = free_names(problem, (*state.accepted, effect.name))
    points = starts(state, effect, found)
    if windows is not None:
        points = [point.acting(switches(effect), windows) for point in points]
    fits = [fit(problem, state.noise, names, point, iterations=2) for point in points]
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
    if state.fit.sse - best.sse > least:
        fits = [fit(problem, state.noise, names, b.values, iterations=4) for b in begun]
        best = min(fits, key=lambda f: f.sse)
    blocks = stretches(state.noise)
    inflation = spread(best, active(effect), blocks)
    plain = state.fit.sse - best.sse
    gain = plain / inflation
    if windows is not None:
        # few stretches disagree little: what scatters over the whole recording counts, and is no better known than its stretches are many
        inflation = max(inflation, inflation_of(found.direction, best.residual, blocks))
        gain = float(chi2.isf(student_squared.sf(max(plain / inflation, 0.0), 1, int(blocks.max()) - 1), 1))
    needed = price(problem, effect, best.values, settings.alpha)
    return Trial(effect.name, best, gain, plain, needed, None, inflation, size_of(effect, best))


def size_of(effect: Effect, fitted: Fit) -> float:
    """What the largest of an effect's switches surely is, in typical changes: to the near end of its 95 % interval."""
    return max(
        max(abs(fitted.values.shared[p.name] - p.value) - SURE * fitted.sd(p.name), 0.0) / abs(p.typical)
        for p in switches(effect)
    )


def starts(state: State, effect: Effect, found: Score) -> list[Values]:
    """Where the refit begins: the expected change, within bounds, and the best probe, which may lie in another minimum; shapes at their
    typical value.
    """
    shapes = {p.name: p.value + p.typical for p in effect.parameters if p.shape}
    expected = {
        p.name: float(np.clip(p.value + change, p.lower, p.upper))
        for p, change in zip(switches(effect), found.change, strict=True)
    }
    points = [state.fit.values, *([state.unstrained] if state.unstrained else [])]
    found_at = [point.with_shared({**shapes, **expected}) for point in points]
    if any(p.probes for p in switches(effect)):
        probe = {p.name: p.tried[min(found.nearest, len(p.tried) - 1)] for p in switches(effect)}
        found_at.append(state.fit.values.with_shared({**shapes, **probe}))
    return found_at


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
        trained = fit(problem, noise, names, start, rows=~test, iterations=4)
        residual[test] = held_out(problem, noise, trained.values, test)[test]
    return residual
