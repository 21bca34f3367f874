"""Finds temporary effects: effects that act in one or a few intervals of time only, and the windows in which they act.

All ranges of windows of a recording are scanned; sums over windows give the scores of all ranges at once. An effect that comes again gets further
ranges by dynamic programming. The threshold of the SSE reduction grows with every range by the number of those that were tried (Bonferroni).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Final

import numpy as np
from scipy.stats import chi2
from scipy.stats import f as f_dist

from discrepancy import gates
from discrepancy.estimation.effort import BRIEF
from discrepancy.estimation.fit import Fit, differences, fit, held_out
from discrepancy.estimation.noise import Noise, estimate_noise
from discrepancy.estimation.problem import Mask, Problem, Values, Windows
from discrepancy.model.description import Effect, Parameter
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
ROUNDING = 1e-6  # share of a column's power; less is left by a projection of what nuisances can do
MOST_RANGES = 4  # of one effect: the choice of the windows left out at their ends doubles with every end
LEAST_POWER = (
    0.05  # of a window's mean share of what an effect does, below which the window says nothing of its size
)


@dataclass(frozen=True, slots=True)
class ActiveInterval:
    """A range of windows in which an effect may act."""

    windows: range
    statistic: float  # of the score in these windows
    size: float  # expected change, in trial steps


@dataclass(frozen=True, slots=True)
class RefinedInterval:
    """A temporary effect: its windows, its fit, and the noise beside it, all estimated together."""

    windows: Windows
    noise: Noise
    without: Fit  # of the model without the effect, under that noise
    with_it: Fit  # with the effect in `windows`
    variance_inflation: float  # of the score over the whole recording
    blocks: int  # of time, from which that inflation is estimated
    evenness: float  # p-value of the scatter of its size over the windows inside, beside that over the windows outside

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
        """Whether the windows inside agree on one size; a true case fails with probability `chance`."""
        return self.evenness > chance


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
    """Threshold of the SSE reduction of an effect: its penalty, plus one for the choice of each of its ranges if it is temporary."""
    always, windows = (
        penalty(effect.size, len(problem.model.effects), alpha),
        active_interval_of(effect, values),
    )
    if windows is None:
        return always
    return always + len(runs(problem, windows)) * search_penalty(window_ranges(problem))


def search_penalty(among: Sequence[range]) -> float:
    """Penalty for the choice of one among so many ranges, 2 ln(count): Bonferroni on the scale of chi-square."""
    return 2.0 * float(np.log(len(among)))


def runs(problem: Problem, windows: Windows) -> list[range]:
    """The ranges of windows, each in one recording, that some windows are made of."""
    found: list[range] = []
    for w in windows:
        follows = found and w == found[-1].stop
        if follows and problem.windows[w].recording == problem.windows[w - 1].recording:
            found[-1] = range(found[-1].start, w + 1)
        else:
            found.append(range(w, w + 1))
    return found


def active_interval_of(effect: Effect, values: Values) -> Windows | None:
    """The windows in which an effect acts; None: all."""
    intervals = values.active_intervals
    return next((intervals[name] for name in effect.amplitude_names if name in intervals), None)


def restricted_to(problem: Problem, columns: Sequence[Columns], windows: Windows) -> list[Columns]:
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
) -> list[tuple[Score, Windows]]:
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
            if (
                interval := best_interval(
                    noise, projector, fitted.residual, raw[:, 0], among, _allowing(c, tried)
                )
            )
        ]
        if not active_intervals:
            continue
        interval, change = max(active_intervals, key=lambda s: s[0].statistic)
        if interval.statistic >= score.raw_statistic + least:
            found.append((interval.statistic, (replace(score, change=change), tuple(interval.windows))))
    return [passing for _, passing in sorted(found, key=lambda f: -f[0])]


def refine_interval(
    problem: Problem,
    noise: Noise,
    effect: Effect,
    names: tuple[str, ...],
    start: Values,
    windows: Windows,
    columns: Sequence[Columns],
    least: float,
) -> RefinedInterval:
    """Noise, size and windows of a temporary effect, estimated in turn until the windows stay.

    names: parameters fitted without the effect; start: values with the effect at its initial size; columns: of all candidates; least: reduction
    of the SSE that each range has to bring.
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
        # SSE of every window with the effect always on, and never on: the best ranges are those with the largest sum of differences
        others = {name: w for name, w in fitted.values.active_intervals.items() if name not in own}
        always = held_out(
            problem, noise, replace(fitted.values, active_intervals=others), everywhere
        ).residual
        never = held_out(problem, noise, fitted.values.with_shared(off), everywhere).residual
        reduction = np.bincount(noise.row_window, never**2 - always**2, len(problem.windows)).astype(float)
        best = best_ranges(reduction, among, least)
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
        *_scatter(noise, (never - always)[:, None], fitted, len(names), runs(problem, windows)),
    )


def best_ranges(reduction: Array, among: Sequence[range], least: float) -> Windows:
    """The windows of the ranges, up to MOST_RANGES and apart from one another, with the largest reduction; each further one has to bring `least`.

    reduction: by window (n,). Dynamic programming over the ranges by their ends, as in the segmentation of a series at an unknown number of change points.
    """
    summed, count = np.concatenate([[0.0], np.cumsum(reduction)]), reduction.size
    by_end: dict[int, list[range]] = {}
    for one in among:
        by_end.setdefault(one.stop, []).append(one)
    # the best choice of k ranges among the windows before `end`, the last of them out: (reduction, ranges)
    nothing: tuple[float, tuple[range, ...]] = (0.0, ())
    earlier, best = [nothing] * (count + 2), (-np.inf, tuple[range, ...]())
    for number in range(MOST_RANGES):
        now: list[tuple[float, tuple[range, ...]]] = [(-np.inf, ())]
        for stop in range(1, count + 1):
            ending = [
                (
                    earlier[one.start][0]
                    + float(summed[stop] - summed[one.start])
                    - (least if number else 0.0),
                    (*earlier[one.start][1], one),
                )
                for one in by_end.get(stop, [])
                if number == 0 or earlier[one.start][1]
            ]
            now.append(max([now[-1], *ending], key=lambda choice: choice[0]))
        chosen = now[count]
        active = sum(map(len, chosen[1]))
        if not chosen[1] or chosen[0] <= best[0] or (number and active > count - FEWEST_WINDOWS):
            break
        best = chosen
        # one window at least lies between two ranges
        earlier = [(-np.inf, ()), *now]
    return tuple(w for one in best[1] for w in one)


def time_varying_nuisance(
    problem: Problem, noise: Noise, without: Fit, active: Windows
) -> tuple[str, float, Windows] | None:
    """The nuisance that would reduce the SSE most with another value in one range of windows, or in `active`: name, SSE reduction, windows; or None.

    Values that its bounds or its sheet exclude are none: a resistance does not grow by twenty standard deviations for a minute.
    """
    base = problem.predict(without.values)
    raw = differences(problem, without.values, base, problem.nuisance_names)
    projector, among = Projector(problem, noise, without), window_ranges(problem)
    acts = np.isin(problem.row_window, active)
    found: list[tuple[str, float, Windows]] = []
    for name, column in zip(problem.nuisance_names, raw.T, strict=True):
        nuisance, value = problem.model.parameter(name), without.values.shared[name]
        best = best_interval(
            noise, projector, without.residual, column, among, partial(_possible, nuisance, value)
        )
        if best is not None:
            found.append((name, best.statistic, tuple(best.windows)))
        free = projector.off(noise.whiten(column * acts)[:, None])[:, 0]
        power, pull = float(free @ free), float(free @ without.residual)
        # a power of rounding's size, or a value that cannot be
        seen = power > ROUNDING * float(np.sum(noise.whiten(column) ** 2))
        if seen and _possible(nuisance, value, pull / power):
            found.append((name, pull**2 / power, active))
    return max(found, key=lambda f: f[1], default=None)


def _possible(nuisance: Parameter, value: float, change: float) -> bool:
    """Whether a nuisance may be another by this change for a while."""
    known, then = nuisance.prior_sd or np.inf, value + change
    return (
        nuisance.lower <= then <= nuisance.upper
        and abs(then - nuisance.value) <= gates.NUISANCE_CHANGED.threshold * known
    )


def _scatter(
    noise: Noise, direction: Array, fitted: Fit, others: int, intervals: Sequence[range]
) -> tuple[float, int, float]:
    """Along a direction (n, 1): variance inflation of the score, the number of blocks of time that it is estimated from, and the evenness.

    others: number of the fit's first columns, which do not belong to the effect.
    """
    # An effect begins and ends somewhere within a window, so the windows at both ends contain only a part of it and would count as
    # disagreement. At each end, of the two windows next to the limit, the one that disagrees more is left out.
    blocks, J = time_blocks_of(noise), fitted.columns[:, :others]
    inflations, evenness = list[tuple[float, int]](), 0.0
    free = direction - J @ np.linalg.lstsq(J, direction, rcond=None)[0]
    limits = [limit for one in intervals for limit in (one.start, one.stop)]
    inside = np.isin(np.arange(noise.window_count), [w for one in intervals for w in one])
    for left_out in product(*((limit - 1, limit) for limit in limits)):
        rows = ~np.isin(noise.row_window, left_out)
        own = np.unique(blocks[rows], return_inverse=True)[1]
        inflation = score_variance_inflation(free[rows], fitted.residual[rows], own)
        inflations.append((inflation, int(own.max()) + 1))
        evenness = max(evenness, _evenness(noise, free[:, 0] * rows, fitted.residual, inside))
    return *min(inflations), evenness


def _evenness(noise: Noise, direction: Array, residual: Array, inside: Mask) -> float:
    """p-value of the scatter of an effect's size over the windows inside, over that of windows outside about zero.

    direction: zero in rows that do not count. What else is missing scatters outside as well; an effect that comes and goes within its interval scatters inside alone.
    """
    count = noise.window_count
    power = np.bincount(noise.row_window, direction**2, count)
    pull = np.bincount(noise.row_window, direction * residual, count)
    # a window in which the effect hardly shows says nothing of its size
    seen = power > LEAST_POWER * float(np.sum(power)) / count
    within, beyond = seen & inside, seen & ~inside
    freedom, outside = int(np.sum(within)) - 1, int(np.sum(beyond))
    if freedom < 1:  # one window agrees with itself: another choice of those left out has to show it
        return 0.0
    common = float(np.sum(pull[within])) / float(np.sum(power[within]))
    scatter = float(np.sum((pull[within] - common * power[within]) ** 2 / power[within])) / freedom
    if not outside:
        return float(chi2.sf(scatter * freedom, freedom))
    usual = max(float(np.sum(pull[beyond] ** 2 / power[beyond])) / outside, 1.0)
    return float(f_dist.sf(scatter / usual, freedom, outside))


def _allowing(columns: Columns, tried: Array) -> Callable[[float], bool]:
    """Whether an effect may have a size, which is given in this trial step."""
    return lambda size: allowed(columns.effect.amplitude_parameters, size * tried)


def best_interval(
    noise: Noise,
    projector: Projector,
    residual: Array,
    raw: Array,
    among: Sequence[range],
    possible: Callable[[float], bool] = lambda _: True,
) -> ActiveInterval | None:
    """The range in which one column of raw sensitivities (N,) scores best, nuisances and initial states projected out.

    possible: whether it may have a size, in units of the column. What acts from the middle on is also what acts until then, the other way round, beside
    another value of a nuisance: both score the same, and only one of them may be.
    """
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
    statistic = np.where(power > ROUNDING * max(own[-1], 1e-300), score**2 / np.maximum(power, 1e-300), 0.0)
    size = score / np.where(statistic > 0.0, power, 1.0)
    for best in np.argsort(-statistic).tolist():
        if statistic[best] == 0.0:
            break
        if possible(float(size[best])):
            return ActiveInterval(among[best], float(statistic[best]), float(size[best]))
    return None
