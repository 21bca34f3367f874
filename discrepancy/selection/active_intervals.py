"""Finds temporary effects: effects that act in one interval of time only, and the range of windows in which they act.

All ranges of windows of a recording are scanned; sums over windows give the scores of all ranges at once. The threshold of the SSE
reduction grows with the number of ranges that were tried (Bonferroni).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.stats import chi2
from scipy.stats import f as f_dist

from discrepancy import gates
from discrepancy.estimation.effort import BRIEF
from discrepancy.estimation.fit import Fit, differences, fit, held_out
from discrepancy.estimation.noise import Noise, estimate_noise
from discrepancy.estimation.problem import Problem, Values
from discrepancy.model.description import Effect
from discrepancy.selection.screen import (
    FEWEST_BLOCKS,
    Columns,
    Projector,
    Score,
    allowed,
    penalty,
    score_variance_inflation,
    time_blocks_of,
)
from discrepancy.selection.unexplained import unexplained
from discrepancy.signals.recording import Array

FEWEST_WINDOWS: Final = int(gates.WINDOWS_OF_INTERVAL.threshold)
ROUNDS = 6  # alternations between range and noise, at most


@dataclass(frozen=True, slots=True)
class ActiveInterval:
    """A range of windows in which an effect may act."""

    windows: range
    statistic: float  # of the score in these windows
    size: float  # expected change, in trial steps


@dataclass(frozen=True, slots=True)
class RefinedInterval:
    """A temporary effect: its windows, its fit, and the noise beside it, all estimated together."""

    windows: range
    noise: Noise
    without: Fit  # of the model without the effect, under that noise
    with_it: Fit  # with the effect in `windows`
    variance_inflation: float  # of the score over the whole recording
    blocks: int  # of time, from which that inflation is estimated

    @property
    def sse_reduction(self) -> float:
        """Reduction of the SSE by the effect."""
        return self.without.sse - self.with_it.sse

    @property
    def sure_sse_reduction(self) -> float:
        """The SSE reduction (chi-square) that is as unlikely by chance as this one."""
        # The variance inflation is itself an estimate from few blocks, so the ratio follows an F and not a chi-square distribution. The
        # thresholds are of chi-square: take the value with the same tail probability.
        beyond = f_dist.sf(max(self.sse_reduction / self.variance_inflation, 0.0), 1, self.blocks - 1)
        return float(chi2.isf(beyond, 1))

    def uniform(self, chance: float) -> bool:
        """Whether the windows inside agree on one size and those outside on zero; a true case fails with probability `chance`."""
        freedom = self.blocks - 1
        return float(chi2.sf(self.variance_inflation * freedom, freedom)) > chance


def window_ranges(problem: Problem) -> list[range]:
    """All ranges of windows within one recording, with enough windows inside and outside; none for expensive models."""
    count = len(problem.windows)
    if problem.costs.costly or count < FEWEST_BLOCKS:
        return []
    owner = [w.recording for w in problem.windows]
    return [
        range(first, stop)
        for first in range(count)
        for stop in range(first + FEWEST_WINDOWS, count + 1)
        if owner[first] == owner[stop - 1] and stop - first <= count - FEWEST_WINDOWS
    ]


def sse_threshold(problem: Problem, effect: Effect, values: Values, alpha: float) -> float:
    """Threshold of the SSE reduction of an effect: its penalty, plus the penalty for the choice of its windows if it is temporary."""
    always = penalty(effect.size, len(problem.model.effects), alpha)
    return always + (search_penalty(window_ranges(problem)) if active_interval_of(effect, values) else 0.0)


def search_penalty(among: Sequence[range]) -> float:
    """Penalty for the choice of one among so many ranges, 2 ln(count): Bonferroni on the scale of chi-square."""
    return 2.0 * float(np.log(len(among)))


def active_interval_of(effect: Effect, values: Values) -> range | None:
    """The windows in which an effect acts; None: all."""
    intervals = values.active_intervals
    return next((intervals[name] for name in effect.amplitude_names if name in intervals), None)


def restricted_to(problem: Problem, columns: Sequence[Columns], windows: range) -> list[Columns]:
    """The sensitivities of effects that act in some windows only."""
    acts = np.isin(problem.row_window, windows)[:, None]
    return [replace(c, raw=tuple(raw * acts for raw in c.raw)) for c in columns]


def temporary_effects(
    problem: Problem,
    noise: Noise,
    fitted: Fit,
    scores: Sequence[Score],
    columns: Sequence[Columns],
    alpha: float,
) -> list[tuple[Score, range]]:
    """Effects whose score in some range exceeds their score in all windows by more than the penalty for the choice; best first."""
    among = window_ranges(problem)
    if not among:
        return []
    projector, found = Projector(problem, noise, fitted), []
    least = penalty(1, len(problem.model.effects), alpha) + search_penalty(among)
    by_name = {s.effect: s for s in scores}
    for c in [c for c in columns if c.effect.size == 1]:
        score = by_name[c.effect.name]
        # every trial step is scanned: a friction that acts for a short time may score best at another step than over the whole recording
        active_intervals = [
            (interval, interval.size * tried)
            for raw, tried in zip(c.raw, c.changes, strict=True)
            if (interval := best_interval(noise, projector, fitted.residual, raw[:, 0], among)) is not None
            and allowed(c.effect.amplitude_parameters, interval.size * tried)
        ]
        if not active_intervals:
            continue
        interval, change = max(active_intervals, key=lambda s: s[0].statistic)
        if interval.statistic >= score.raw_statistic + least:
            found.append((interval.statistic, (replace(score, change=change), interval.windows)))
    return [passing for _, passing in sorted(found, key=lambda f: -f[0])]


def refine_interval(
    problem: Problem,
    noise: Noise,
    effect: Effect,
    names: tuple[str, ...],
    start: Values,
    windows: range,
    columns: Sequence[Columns],
) -> RefinedInterval:
    """Noise, size and windows of a temporary effect, estimated in turn until the windows stay.

    names: parameters fitted without the effect; start: values with the effect at its initial size; columns: of all candidates.
    """
    # A single pass is not enough. Noise estimated without the effect contains a part of it, and scores are linear, so they are wrong
    # where the effect stops the machine. Windows are therefore chosen by the reduction that the fitted effect itself brings.
    own = dict.fromkeys(p.name for p in effect.parameters)
    off = {p.name: p.value for p in effect.parameters}
    among, everywhere = window_ranges(problem), np.ones(noise.keep.size, bool)
    fitted = fit(
        problem, noise, (*names, *own), start.active_in(effect.amplitude_parameters, windows), effort=BRIEF
    )
    for _ in range(ROUNDS):
        raw = problem.measured - problem.predict(fitted.values)
        noise = estimate_noise(problem, *unexplained(problem, noise, fitted, raw, columns), noise)
        everywhere = np.ones(noise.keep.size, bool)
        fitted = fit(problem, noise, (*names, *own), fitted.values, effort=BRIEF)
        # SSE of every window with the effect always on, and never on: the best range is that with the largest sum of differences
        others = {name: w for name, w in fitted.values.active_intervals.items() if name not in own}
        always = held_out(
            problem, noise, replace(fitted.values, active_intervals=others), everywhere
        ).residual
        never = held_out(problem, noise, fitted.values.with_shared(off), everywhere).residual
        reduction = np.bincount(noise.row_window, never**2 - always**2, len(problem.windows))
        summed = np.concatenate([[0.0], np.cumsum(reduction)])
        best = max(among, key=lambda windows: float(summed[windows.stop] - summed[windows.start]))
        if best == windows:
            break
        windows = best
        fitted = fit(
            problem,
            noise,
            fitted.names,
            fitted.values.active_in(effect.amplitude_parameters, windows),
            effort=BRIEF,
        )
    without = fit(problem, noise, names, fitted.values.with_shared(off))
    return RefinedInterval(
        windows,
        noise,
        without,
        fitted,
        *_variance_inflation(noise, (never - always)[:, None], fitted, len(names), windows),
    )


def time_varying_nuisance(problem: Problem, noise: Noise, without: Fit) -> tuple[str, float, range] | None:
    """The nuisance that would reduce the SSE most with another value in one range of windows: name, SSE reduction, windows; or None."""
    base = problem.predict(without.values)
    raw = differences(problem, without.values, base, problem.nuisance_names)
    projector, among = Projector(problem, noise, without), window_ranges(problem)
    found = [
        (name, best.statistic, best.windows)
        for name, column in zip(problem.nuisance_names, raw.T, strict=True)
        if (best := best_interval(noise, projector, without.residual, column, among)) is not None
    ]
    return max(found, key=lambda f: f[1], default=None)


def _variance_inflation(
    noise: Noise, direction: Array, fitted: Fit, others: int, interval: range
) -> tuple[float, int]:
    """Variance inflation of the score along a direction (n, 1), and the number of blocks of time that it is estimated from.

    others: number of the fit's first columns, which do not belong to the effect.
    """
    # An effect begins and ends somewhere within a window, so the windows at both ends contain only a part of it and would count as
    # disagreement. At each end, of the two windows next to the limit, the one that disagrees more is left out.
    blocks, found, J = time_blocks_of(noise), [], fitted.columns[:, :others]
    free = direction - J @ np.linalg.lstsq(J, direction, rcond=None)[0]
    for start in (interval.start - 1, interval.start):
        for stop in (interval.stop - 1, interval.stop):
            rows = ~np.isin(noise.row_window, (start, stop))
            own = np.unique(blocks[rows], return_inverse=True)[1]
            inflation = score_variance_inflation(free[rows], fitted.residual[rows], own)
            found.append((inflation, int(own.max()) + 1))
    return min(found)


def best_interval(
    noise: Noise, projector: Projector, residual: Array, raw: Array, among: Sequence[range]
) -> ActiveInterval | None:
    """The range in which one column of raw sensitivities (N,) scores best, nuisances and initial states projected out."""
    if not among:
        return None
    white = projector.states.off(noise.whiten(raw))
    columns, inverse = projector.nuisances
    count = noise.window_count

    # Score and power of a range follow from differences of cumulative sums over windows: about n²/2 ranges cost n sums. Initial
    # states belong to single windows and are projected out first; nuisances couple the windows and are subtracted below by the Schur
    # complement of their normal matrix.
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
    return ActiveInterval(among[best], float(statistic[best]), float(score[best] / power[best]))
