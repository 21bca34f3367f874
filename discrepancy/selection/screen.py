"""The screen: scores (Lagrange multiplier tests) of all effects, from one simulation per parameter and trial step.

Statistic, expected change and power follow Rao (1948) and Saris, Satorra and Sörbom (1987). Trial steps are finite, because the gradient of
lags and friction vanishes at zero. A wrong noise model leaves correlation in the scores: it is measured over blocks of time, as the variance
inflation, and the statistic is divided by it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, ncx2

from discrepancy import gates
from discrepancy.estimation.fit import Fit, WindowStates, differences
from discrepancy.estimation.noise import Noise
from discrepancy.estimation.normal_equations import inverse, root
from discrepancy.estimation.problem import Problem, Values
from discrepancy.model.description import FEW, Effect, Parameter
from discrepancy.signals.recording import Array

INVISIBLE = 1e-6  # share of an effect's squared sensitivity after projection, below which it is only rounding
BLOCKS = (
    30  # of time: enough for a variance to some 25 %, and each still long against the memory of the noise
)
FEWEST_BLOCKS: Final = int(gates.BLOCKS_TO_COMPARE.threshold)
MOST_LEVERAGE = 0.5  # of one block: if it contains more than all others together, they cannot check it


@dataclass(frozen=True, slots=True)
class Columns:
    """Raw sensitivities of one effect, per trial step."""

    effect: Effect
    raw: tuple[Array, ...]  # changes of the raw rows (N, amplitude parameters) by the trial step
    changes: tuple[Array, ...]  # the trial step itself (amplitude parameters,), in their units


@dataclass(frozen=True, slots=True)
class Score:
    """The score of one effect, with no other effect added."""

    effect: str
    statistic: float  # chi-square with `freedom` degrees if the effect is absent; 0 if the expected change is out of bounds
    freedom: int
    trial_step: int  # index of the trial step with the best statistic
    nearest: int  # index of the trial step that leaves the smallest residual if it is taken as it is
    change: Array  # expected change of each amplitude parameter, in its unit
    power: float  # probability of finding a typical change
    confounded_share: float  # share of the effect that refitted nuisances imitate
    variance_inflation: float  # variance of the score over that of white innovations, at least 1
    direction: Array  # projected sensitivity (n, freedom), whitened
    within_bounds: bool

    @property
    def raw_statistic(self) -> float:
        """The statistic before the division by the variance inflation."""
        return self.statistic * self.variance_inflation

    @property
    def p_value(self) -> float:
        """Probability of a statistic at least as large if the effect is absent."""
        return float(chi2.sf(self.statistic, self.freedom))


def sensitivities(
    problem: Problem, values: Values, base: Array, effects: Sequence[Effect], *, cached: bool = False
) -> list[Columns]:
    """Sensitivities of each effect at each of its trial steps, with shape parameters at their typical values. cached: columns kept at any other
    point may be used.
    """
    tried = {
        (effect.name, step, p.name): p.trial_values[min(step, len(p.trial_values) - 1)]
        for effect in effects
        for step in range(_trial_steps(effect))
        for p in effect.amplitude_parameters
    }
    raw = {
        key: problem.jacobian.column(key[2], value, values.shared, anywhere=cached)
        for key, value in tried.items()
    }
    new = [key for key, column in raw.items() if column is None]
    shapes = {e.name: e.shapes_at_typical for e in effects}
    points = [values.with_shared({**shapes[key[0]], key[2]: tried[key]}) for key in new]
    for key, rows in zip(new, problem.predict_each(points), strict=True):
        raw[key] = column = rows - base
        problem.jacobian.keep(key[2], tried[key], values.shared, column)
    found = []
    for effect in effects:
        own = effect.amplitude_parameters
        keys = [[(effect.name, step, p.name) for p in own] for step in range(_trial_steps(effect))]
        found.append(
            Columns(
                effect,
                tuple(
                    np.stack([c for k in of_step if (c := raw[k]) is not None], axis=1) for of_step in keys
                ),
                tuple(
                    np.array([tried[k] - p.value for k, p in zip(of_step, own, strict=True)])
                    for of_step in keys
                ),
            )
        )
    return found


def changes_at(effect: Effect, trial_step: int) -> Array:
    """Changes of its amplitude parameters (k,) that a trial step tries."""
    return np.array(
        [
            p.trial_values[min(trial_step, len(p.trial_values) - 1)] - p.value
            for p in effect.amplitude_parameters
        ]
    )


def _trial_steps(effect: Effect) -> int:
    own = effect.amplitude_parameters
    return 1 if effect.is_profile else max(len(p.trial_values) for p in own)


def projected(
    noise: Noise, projector: "Projector", columns: Sequence[Columns]
) -> list[list[tuple[Array, float]]]:
    """Per effect and trial step: whitened sensitivity with nuisances and initial states projected out, and its squared size before."""
    # all columns at once, which is faster than whitening them one by one
    parts = [raw for c in columns for raw in c.raw]
    if not parts:
        return []
    white = noise.whiten(np.concatenate(parts, axis=1))
    free = projector.off(projector.states.off(white))
    size = np.sum(white**2, axis=0)
    edges = np.cumsum([0, *(raw.shape[1] for raw in parts)]).tolist()
    found = iter([(free[:, a:b], float(np.sum(size[a:b]))) for a, b in pairwise(edges)])
    return [[next(found) for _ in c.raw] for c in columns]


class Projector:
    """Projects nuisances, accepted effects and initial states out of whitened columns, at one fit."""

    def __init__(
        self, problem: Problem, noise: Noise, at: Fit, rows: NDArray[np.bool_] | None = None
    ) -> None:
        chosen = np.ones(noise.keep.size, bool) if rows is None else rows
        base = problem.predict(at.values)
        local = noise.whiten(differences(problem, at.values, base, problem.local_names))
        self.states = WindowStates(local, noise.row_window, chosen)
        self._columns, self._inverse = at.columns, at.covariance

    @property
    def nuisances(self) -> tuple[Array, Array]:
        """Whitened columns of the fitted parameters (n, k), and their inverse normal matrix with priors (k, k)."""
        return self._columns, self._inverse

    def off(self, columns: Array) -> Array:
        """Columns (n, k) without the part that nuisances can produce within their priors."""
        free = self.states.off(columns)
        return free - self._columns @ (self._inverse @ (self._columns.T @ free))


def score_variance_inflation(direction: Array, residual: Array, blocks: NDArray[np.intp]) -> float:
    """Variance of the score over its value for white innovations, at least 1, from sums over blocks of time."""
    count = int(blocks.max()) + 1
    if count < 6:  # the variance of so few sums would be arbitrary
        return 1.0
    norm = np.sqrt(np.sum(direction**2, axis=0))
    norm[norm == 0.0] = 1.0
    X = direction / norm
    clean = residual - X @ np.linalg.lstsq(X, residual, rcond=None)[0]
    sums = np.stack([np.bincount(blocks, x * clean, count) for x in X.T], axis=1)
    leverage = np.stack([np.bincount(blocks, x**2, count) for x in X.T], axis=1)
    # The fit follows a block more closely the more of the direction lies in it, so its sum is too small: divide it by one minus its
    # leverage (Bell and McCaffrey 2002, the linearised jackknife). Innovations have variance 1, so the expected value is 1.
    spread = np.sum((sums / (1.0 - np.minimum(leverage, MOST_LEVERAGE))) ** 2, axis=0) * (count - 1) / count
    return max(1.0, float(np.mean(spread)))


def jackknife(fitted: Fit, blocks: NDArray[np.intp], most: float) -> Array:
    """Variance of each fitted parameter (k,) from estimates that leave out one block each (Efron 1982), linearised; 0 if there are few blocks.

    most: largest share of the information in any direction that leaving out one block may remove.
    """
    # Without a block that alone determines a direction there is no estimate in it, hence the limit `most`.
    moved, half = [], root(fitted.information)
    for block in range(int(blocks.max()) + 1):
        rows = blocks == block
        J = fitted.columns[rows]
        leverage, directions = np.linalg.eigh(half.T @ (J.T @ J) @ half)
        pulls = directions.T @ (half.T @ (J.T @ fitted.residual[rows]))
        moved.append(half @ (directions @ (pulls / (1.0 - np.minimum(leverage, most)))))
    if len(moved) < FEWEST_BLOCKS:
        return np.zeros(len(fitted.names))
    return np.asarray((len(moved) - 1) * np.var(moved, axis=0), float)


def spread(fitted: Fit, names: Sequence[str], blocks: NDArray[np.intp]) -> float:
    """Variance inflation of parameters: jackknife variance over blocks of time, over the variance for white innovations; at least 1."""
    own = [fitted.names.index(name) for name in names]
    white = np.diag(fitted.covariance)[own]
    seen = white > 0.0
    return (
        max(1.0, float(np.mean(jackknife(fitted, blocks, MOST_LEVERAGE)[own][seen] / white[seen])))
        if seen.any()
        else 1.0
    )


def time_blocks_of(noise: Noise) -> NDArray[np.intp]:
    """Number of the block of time each whitened row belongs to, about BLOCKS that know nothing of one another.

    Windows are not cut where there are enough: their initial states tie all rows of one together.
    """
    count = noise.window_count
    if count < FEWEST_BLOCKS:
        return time_blocks(noise, BLOCKS)
    return np.asarray(noise.row_window * min(count, BLOCKS) // count, np.intp)


def time_blocks(noise: Noise, count: int) -> NDArray[np.intp]:
    """Block number of each whitened row (n,): about `count` blocks of equal size in time, of 20 rows at least."""
    order = np.lexsort((noise.row_time, noise.row_window))
    block = np.empty(order.size, np.intp)
    block[order] = np.arange(order.size) * min(count, max(1, order.size // 20)) // order.size
    return block


def score(
    columns: Columns,
    seen_by: Sequence[tuple[Array, float]],
    residual: Array,
    critical: float,
    blocks: NDArray[np.intp],
) -> Score:
    """The score of one effect at its best trial step.

    seen_by: from `projected`; critical: threshold of the statistic, for the power.
    """
    left = [float(np.sum((residual - X.sum(axis=1)) ** 2)) for X, _ in seen_by]
    nearest = int(np.argmin(left))
    scores = [
        _score_at(columns, step, seen, residual, critical, blocks, nearest)
        for step, seen in enumerate(seen_by)
    ]
    return max(scores, key=lambda s: s.statistic)


def _score_at(
    columns: Columns,
    step: int,
    seen: tuple[Array, float],
    residual: Array,
    critical: float,
    blocks: NDArray[np.intp],
    nearest: int,
) -> Score:
    (X, whole), change, own = seen, columns.changes[step], columns.effect.amplitude_parameters
    total = X.T @ residual
    coefficient = inverse(X.T @ X) @ total
    raw_statistic = float(total @ coefficient)
    inflation = score_variance_inflation(X, residual, blocks) if X.any() else 1.0
    moved = coefficient * change
    within_bounds, visible = allowed(own, moved), float(np.sum(X**2))
    if visible < INVISIBLE * whole or whole == 0.0:
        within_bounds, visible = False, 0.0  # nuisances or initial states produce exactly the same
    # of the least visible combination of parameters: the power then holds for every typical change
    noncentrality = least_seen(X, np.array([p.typical for p in own]) / change) / inflation if visible else 0.0
    return Score(
        effect=columns.effect.name,
        statistic=raw_statistic / inflation if within_bounds else 0.0,
        freedom=len(change),
        trial_step=step,
        nearest=nearest,
        change=moved,
        power=float(ncx2.sf(critical, len(change), noncentrality)) if noncentrality > 0.0 else 0.0,
        confounded_share=max(1.0 - visible / whole, 0.0) if whole > 0.0 else 0.0,
        variance_inflation=inflation,
        direction=X,
        within_bounds=within_bounds,
    )


def allowed(parameters: Sequence[Parameter], moved: Array) -> bool:
    """Whether an expected change is within the bounds, or nearly; always true for several parameters."""
    # Several parameters share one expected change, and a single one may lie beyond its bound where the joint optimum does not.
    beyond, half = gates.OUTSIDE_BOUNDS.threshold, gates.DISCRETE_SHARE.threshold
    return len(parameters) > 1 or all(
        p.lower - beyond * abs(p.typical) <= p.value + m <= p.upper + beyond * abs(p.typical)
        and (not p.discrete or abs(m - p.typical) < half * abs(p.typical))
        and (np.isinf(p.lower) or p.lower < p.value or m > 0.0)
        for p, m in zip(parameters, moved, strict=True)
    )


def least_seen(direction: Array, typical: Array) -> float:
    """Squared whitened size of the least visible combination of typical changes; for a profile, the mean over its parameters.

    direction: projected sensitivity to the trial step (n, k); typical: typical changes in trial steps (k,).
    """
    if typical.size > FEW:
        return float(np.sum(direction**2) * np.mean(typical**2))
    scaled = direction * typical
    return max(float(np.linalg.eigvalsh(scaled.T @ scaled)[0]), 0.0)


def penalty(freedom: int, candidates: int, alpha: float) -> float:
    """Threshold of an SSE reduction: Bonferroni over the candidates, and at least 2 ln(K / alpha) + freedom - 1."""
    # For one degree of freedom P(chi² > x) <= exp(-x / 2): this bound lies above the exact Bonferroni value and leaves room for
    # innovations with heavier tails than a normal distribution.
    bonferroni = float(chi2.isf(alpha / candidates, freedom))
    return max(bonferroni, 2.0 * float(np.log(candidates / alpha)) + freedom - 1.0)


def collinearity(one: Array, other: Array) -> float:
    """Largest cosine between two spans of projected sensitivities (first canonical correlation): 0 distinguishable, 1 indistinguishable."""
    if not one.any() or not other.any():
        return 0.0
    Q1, Q2 = np.linalg.qr(one)[0], np.linalg.qr(other)[0]
    return float(np.clip(np.linalg.svd(Q1.T @ Q2, compute_uv=False)[0], 0.0, 1.0))


def by_statistic(scores: Sequence[Score]) -> list[Score]:
    """Best first. By p-value, because statistics with different degrees of freedom are not comparable."""
    return sorted(scores, key=lambda s: s.p_value if s.statistic > 0 else 2.0)
