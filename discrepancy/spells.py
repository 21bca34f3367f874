"""Effects that act for a while only: the run of windows in which one scores best.

A scan over all runs of windows of a recording: sums over windows give each of them at once. What a gain must exceed grows with the
number of runs that were searched (Bonferroni).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2
from scipy.stats import f as student_squared

from discrepancy.fit import Fit, differences, fit, held_out
from discrepancy.model import Effect
from discrepancy.noise import Noise, estimate_noise
from discrepancy.problem import Problem, Values
from discrepancy.recording import Array
from discrepancy.screen import (
    FEWEST_STRETCHES,
    Columns,
    Projector,
    Score,
    active,
    allowed,
    inflation_of,
    penalty,
    stretches,
    switches,
)
from discrepancy.unexplained import unexplained

FEWEST_WINDOWS = 3  # of a spell, and outside of it
ROUNDS = 6  # of windows and noise


@dataclass(frozen=True, slots=True)
class Spell:
    """Windows in which an effect acts, the statistic of the score there, and its size in units of the change that was tried."""

    windows: range
    statistic: float
    size: float


@dataclass(frozen=True, slots=True)
class Settled:
    """An effect that acts in some windows, and the noise that is left beside it, each estimated with the other.

    without, with_it: fits under that noise; inflation: of the score over the whole recording; stretches: of time, that it rests on.
    """

    windows: range
    noise: Noise
    without: Fit
    with_it: Fit
    inflation: float
    stretches: int

    @property
    def gain(self) -> float:
        """In SSE."""
        return self.without.sse - self.with_it.sse

    @property
    def sure_gain(self) -> float:
        """The gain that would be as unlikely by chance if the inflation were known; it is no better known than its stretches are many."""
        beyond = student_squared.sf(max(self.gain / self.inflation, 0.0), 1, self.stretches - 1)
        return float(chi2.isf(beyond, 1))

    def even(self, chance: float) -> bool:
        """Whether its windows agree on its size, and the others on none, but for a chance."""
        freedom = self.stretches - 1
        return float(chi2.sf(self.inflation * freedom, freedom)) > chance


def runs(problem: Problem) -> list[range]:
    """All runs of windows of one recording, with enough windows in and outside; none for models too costly to try them."""
    count = len(problem.windows)
    if problem.model.costly or count < FEWEST_STRETCHES:
        return []
    owner = [w.recording for w in problem.windows]
    return [
        range(first, stop)
        for first in range(count)
        for stop in range(first + FEWEST_WINDOWS, count + 1)
        if owner[first] == owner[stop - 1] and stop - first <= count - FEWEST_WINDOWS
    ]


def price(problem: Problem, effect: Effect, values: Values, alpha: float) -> float:
    """What the gain of an effect must exceed: its penalty, and that for the choice of the windows in which it acts."""
    plain = penalty(effect.size, len(problem.model.effects), alpha)
    return plain + (searched(runs(problem)) if spell_of(effect, values) else 0.0)


def searched(among: Sequence[range]) -> float:
    """Penalty for the choice of one of so many runs of windows."""
    return 2.0 * float(np.log(len(among)))


def spell_of(effect: Effect, values: Values) -> range | None:
    """Windows in which an effect acts; None if in all."""
    return next((values.spells[name] for name in active(effect) if name in values.spells), None)


def within(problem: Problem, columns: Sequence[Columns], windows: range) -> list[Columns]:
    """Sensitivities to effects that act in some windows only."""
    acts = np.isin(problem.row_window, windows)[:, None]
    return [replace(c, raw=tuple(raw * acts for raw in c.raw)) for c in columns]


def for_a_while(
    problem: Problem,
    noise: Noise,
    fitted: Fit,
    scores: Sequence[Score],
    columns: Sequence[Columns],
    alpha: float,
) -> list[tuple[Score, range]]:
    """The effects that score better in some run of windows than in all, as far as the choice of the run allows; best first."""
    among = runs(problem)
    if not among:
        return []
    projector, found = Projector(problem, noise, fitted), []
    least = penalty(1, len(problem.model.effects), alpha) + searched(among)
    by_name = {s.effect: s for s in scores}
    for c in [c for c in columns if c.effect.size == 1]:
        score = by_name[c.effect.name]
        # friction that acts for a while is seen at one probe where over the whole recording another one leads
        spells = [
            (spell, spell.size * tried)
            for raw, tried in zip(c.raw, c.changes, strict=True)
            if (spell := best_spell(noise, projector, fitted.residual, raw[:, 0], among)) is not None
            and allowed(switches(c.effect), spell.size * tried)
        ]
        if not spells:
            continue
        spell, change = max(spells, key=lambda s: s[0].statistic)
        if spell.statistic >= score.statistic * score.inflation + least:
            found.append((spell.statistic, (replace(score, change=change), spell.windows)))
    return [passing for _, passing in sorted(found, key=lambda f: -f[0])]


def settle(
    problem: Problem,
    noise: Noise,
    effect: Effect,
    names: tuple[str, ...],
    begun: Values,
    windows: range,
    columns: Sequence[Columns],
) -> Settled:
    """Noise, size and windows of an effect that acts for a while, in turn until the windows stay: noise that was estimated without knowing of
    it holds it too, and scores, which are local, err where it brings the model to a stop.

    names: what is fitted without it; begun: values with the effect at the size from which to begin; columns: of all candidates.
    """
    own = dict.fromkeys(p.name for p in effect.parameters)
    off = {p.name: p.value for p in effect.parameters}
    among, everywhere = runs(problem), np.ones(noise.keep.size, bool)
    fitted = fit(problem, noise, (*names, *own), begun.acting(switches(effect), windows), iterations=4)
    for _ in range(ROUNDS):
        raw = problem.measured - problem.predict(fitted.values)
        noise = estimate_noise(problem, *unexplained(problem, noise, fitted, raw, columns), noise)
        everywhere = np.ones(noise.keep.size, bool)
        fitted = fit(problem, noise, (*names, *own), fitted.values, iterations=4)
        spells = {name: spell for name, spell in fitted.values.spells.items() if name not in own}
        always = held_out(problem, noise, replace(fitted.values, spells=spells), everywhere).residual
        never = held_out(problem, noise, fitted.values.with_shared(off), everywhere).residual
        gain = np.bincount(noise.row_window, never**2 - always**2, len(problem.windows))
        gained = np.concatenate([[0.0], np.cumsum(gain)])
        best = max(among, key=lambda run: float(gained[run.stop] - gained[run.start]))
        if best == windows:
            break
        windows = best
        fitted = fit(
            problem, noise, fitted.names, fitted.values.acting(switches(effect), windows), iterations=4
        )
    without = fit(problem, noise, names, fitted.values.with_shared(off))
    return Settled(
        windows,
        noise,
        without,
        fitted,
        *_scatter(noise, (never - always)[:, None], fitted, len(names), windows),
    )


def changing_nuisance(problem: Problem, noise: Noise, without: Fit) -> tuple[str, float, range] | None:
    """The nuisance that would explain most if it were another for a while, with its gain in SSE and the windows; None if there is none."""
    base = problem.predict(without.values)
    raw = differences(problem, without.values, base, problem.nuisance_names)
    projector, among = Projector(problem, noise, without), runs(problem)
    found = [
        (name, best.statistic, best.windows)
        for name, column in zip(problem.nuisance_names, raw.T, strict=True)
        if (best := best_spell(noise, projector, without.residual, column, among)) is not None
    ]
    return max(found, key=lambda f: f[1], default=None)


def _scatter(noise: Noise, direction: Array, fitted: Fit, others: int, spell: range) -> tuple[float, int]:
    """Inflation of the score along a direction (n, 1), and the number of stretches of time it rests on; others: columns of the fit that come
    first and are no part of the effect.

    An effect begins and ends somewhere within a window: of the two windows at each end, that one is left out which agrees least with the rest.
    """
    blocks, found, J = stretches(noise), [], fitted.columns[:, :others]
    free = direction - J @ np.linalg.lstsq(J, direction, rcond=None)[0]
    for start in (spell.start - 1, spell.start):
        for stop in (spell.stop - 1, spell.stop):
            rows = ~np.isin(noise.row_window, (start, stop))
            own = np.unique(blocks[rows], return_inverse=True)[1]
            found.append((inflation_of(free[rows], fitted.residual[rows], own), int(own.max()) + 1))
    return min(found)


def best_spell(
    noise: Noise, projector: Projector, residual: Array, raw: Array, among: Sequence[range]
) -> Spell | None:
    """The run in which one column of raw sensitivities (N,) scores best, nuisances and initial states projected out."""
    if not among:
        return None
    white = projector.states.off(noise.whiten(raw))
    columns, inverse = projector.nuisances
    count = int(noise.row_window.max()) + 1

    def summed(rows: Array) -> Array:
        return np.concatenate([[0.0], np.cumsum(np.bincount(noise.row_window, rows, count))])

    own, seen = summed(white**2), summed(white * residual)
    shared = np.array([summed(white * column) for column in columns.T]).reshape(-1, count + 1).T
    pull = inverse @ (columns.T @ residual)
    first, stop = np.array([r.start for r in among]), np.array([r.stop for r in among])
    cross = shared[stop] - shared[first]
    power = own[stop] - own[first] - np.einsum("ri,ij,rj->r", cross, inverse, cross)
    score = seen[stop] - seen[first] - cross @ pull
    statistic = np.where(power > 1e-6 * max(own[-1], 1e-300), score**2 / np.maximum(power, 1e-300), 0.0)
    best = int(np.argmax(statistic))
    if statistic[best] == 0.0:
        return None
    return Spell(among[best], float(statistic[best]), float(score[best] / power[best]))
