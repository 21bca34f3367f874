"""Score (Lagrange multiplier) screen: one simulation per candidate parameter and probe, nuisances projected out.

Statistic, expected change and power after Rao and after Saris, Satorra and Sorbom (1987). Probes are finite changes, so that
lags and friction, whose gradient vanishes at zero, are scored too. Correlation left in the scores, which a
wrong noise model leaves there, is measured over blocks of time and divides the statistic.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, ncx2

from discrepancy.fit import Fit, WindowStates, differences
from discrepancy.model import Effect, Parameter
from discrepancy.noise import Noise
from discrepancy.normal import inverse, root
from discrepancy.problem import Problem, Values
from discrepancy.recording import Array

INVISIBLE = 1e-6  # share of an effect left after projection, below which only rounding is seen
FEW = 3  # parameters; longer profiles are linear and scored at one size
BLOCKS = 30  # of time, for the spread of the scores
FEWEST_STRETCHES = 8  # whose disagreement says something
HALF = 0.5  # of a change that is there or not, from which it is nearer to being there
MOST_LEVERAGE = 0.5  # a block that holds more than the others together cannot be compared with them


@dataclass(frozen=True, slots=True)
class Columns:
    """Raw sensitivities of one effect at its probes: per probe, (N, parameters) in probe units, and the changes tried."""

    effect: Effect
    raw: tuple[Array, ...]
    changes: tuple[Array, ...]  # (parameters,) per probe


@dataclass(frozen=True, slots=True)
class Score:
    """What the screen says of one effect, all else equal.

    statistic: chi-square with `freedom` degrees when nothing is missing (0 if the change is out of bounds);
    probe, change: where the statistic is best, and the change expected from there of each parameter that is no shape; nearest: the probe
    that itself leaves least, whatever the slope says there; power: probability to find a typical change;
    absorbed: share of the effect that refitted nuisances could hide; inflation: of the variance of the score.
    """

    effect: str
    statistic: float
    freedom: int
    probe: int
    nearest: int
    change: Array
    power: float
    absorbed: float
    inflation: float
    direction: Array  # projected sensitivity (n, freedom), whitened
    plausible: bool

    @property
    def p_value(self) -> float:
        return float(chi2.sf(self.statistic, self.freedom))


def active(effect: Effect) -> list[str]:
    """Names of the parameters that switch the effect on."""
    return [p.name for p in switches(effect)]


def sensitivities(
    problem: Problem, values: Values, base: Array, effects: Sequence[Effect], *, rough: bool = False
) -> list[Columns]:
    """Simulate each effect at each of its probes, shapes at their typical value. rough: those kept from elsewhere serve as well."""
    tried = {
        (effect.name, probe, p.name): p.tried[min(probe, len(p.tried) - 1)]
        for effect in effects
        for probe in range(_probes(effect))
        for p in switches(effect)
    }
    raw = {key: problem.kept_slope(key[2], value, values, anywhere=rough) for key, value in tried.items()}
    new = [key for key, column in raw.items() if column is None]
    shapes = {e.name: {p.name: p.value + p.typical for p in e.parameters if p.shape} for e in effects}
    points = [values.with_shared({**shapes[key[0]], key[2]: tried[key]}) for key in new]
    for key, rows in zip(new, problem.predict_each(points), strict=True):
        raw[key] = column = rows - base
        problem.keep_slope(key[2], tried[key], values, column)
    found = []
    for effect in effects:
        own = [[(effect.name, probe, p.name) for p in switches(effect)] for probe in range(_probes(effect))]
        found.append(
            Columns(
                effect,
                tuple(np.stack([c for k in keys if (c := raw[k]) is not None], axis=1) for keys in own),
                tuple(
                    np.array([tried[k] - p.value for k, p in zip(keys, switches(effect), strict=True)])
                    for keys in own
                ),
            )
        )
    return found


def switches(effect: Effect) -> list[Parameter]:
    """Parameters that switch the effect on (all but shapes)."""
    return [p for p in effect.parameters if not p.shape]


def changes_at(effect: Effect, probe: int) -> Array:
    """Changes of its switches (k,) that a probe tries."""
    return np.array([p.tried[min(probe, len(p.tried) - 1)] - p.value for p in switches(effect)])


def _probes(effect: Effect) -> int:
    own = switches(effect)
    return max(len(p.tried) for p in own) if len(own) <= FEW else 1


def projected(
    noise: Noise, projector: "Projector", columns: Sequence[Columns]
) -> list[list[tuple[Array, float]]]:
    """Per effect and probe: whitened sensitivity beyond nuisances and initial states, and its squared size before; all at once."""
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
    """Takes nuisances and accepted effects, with their priors and initial states, out of whitened columns."""

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
        """Whitened columns of what is fitted (n, k), and their inverse normal matrix with priors (k, k)."""
        return self._columns, self._inverse

    def off(self, columns: Array) -> Array:
        """(n, k) -> (n, k), orthogonal to what nuisances can do (as far as their priors let them)."""
        free = self.states.off(columns)
        return free - self._columns @ (self._inverse @ (self._columns.T @ free))


def inflation_of(direction: Array, residual: Array, blocks: NDArray[np.intp]) -> float:
    """Variance of the score over its value for white innovations, at least 1, from sums over blocks of time.

    The fit follows a block the more closely, the more of the direction lies in it: each sum is divided by what its own
    leverage leaves (Bell and McCaffrey 2002, the linearised jackknife).
    """
    count = int(blocks.max()) + 1
    if count < 6:
        return 1.0
    norm = np.sqrt(np.sum(direction**2, axis=0))
    norm[norm == 0.0] = 1.0
    X = direction / norm
    clean = residual - X @ np.linalg.lstsq(X, residual, rcond=None)[0]
    sums = np.stack([np.bincount(blocks, x * clean, count) for x in X.T], axis=1)
    leverage = np.stack([np.bincount(blocks, x**2, count) for x in X.T], axis=1)
    # innovations have variance 1 by construction
    spread = np.sum((sums / (1.0 - np.minimum(leverage, MOST_LEVERAGE))) ** 2, axis=0) * (count - 1) / count
    return max(1.0, float(np.mean(spread)))


def jackknife(fitted: Fit, blocks: NDArray[np.intp], most: float) -> Array:
    """Variance of each fitted parameter (k,) from estimates that leave out one block each (Efron 1982), linearised; 0 if blocks are few.

    Without a block that alone tells of a parameter there would be no estimate: one that has more than the share `most` of what is known
    in some direction is left out only as far as that.
    """
    moved, half = [], root(fitted.information)
    for block in range(int(blocks.max()) + 1):
        rows = blocks == block
        J = fitted.columns[rows]
        leverage, directions = np.linalg.eigh(half.T @ (J.T @ J) @ half)
        pulls = directions.T @ (half.T @ (J.T @ fitted.residual[rows]))
        moved.append(half @ (directions @ (pulls / (1.0 - np.minimum(leverage, most)))))
    if len(moved) < FEWEST_STRETCHES:
        return np.zeros(len(fitted.names))
    return np.asarray((len(moved) - 1) * np.var(moved, axis=0), float)


def spread(fitted: Fit, names: Sequence[str], blocks: NDArray[np.intp]) -> float:
    """By how much the estimates of parameters vary more than white innovations would have them: ratio of variances, at least 1."""
    own = [fitted.names.index(name) for name in names]
    plain = np.diag(fitted.covariance)[own]
    seen = plain > 0.0
    return (
        max(1.0, float(np.mean(jackknife(fitted, blocks, MOST_LEVERAGE)[own][seen] / plain[seen])))
        if seen.any()
        else 1.0
    )


def stretches(noise: Noise) -> NDArray[np.intp]:
    """Number of the stretch of time each whitened row belongs to, about BLOCKS that know nothing of one another.

    Windows are not cut where there are enough: their initial states tie all rows of one together.
    """
    count = int(noise.row_window.max()) + 1
    if count < FEWEST_STRETCHES:
        return time_blocks(noise, BLOCKS)
    return np.asarray(noise.row_window * min(count, BLOCKS) // count, np.intp)


def time_blocks(noise: Noise, count: int) -> NDArray[np.intp]:
    """Number of the stretch of time each whitened row belongs to, about `count` of equal size."""
    order = np.lexsort((noise.row_time, noise.row_window))
    stretch = np.empty(order.size, np.intp)
    stretch[order] = np.arange(order.size) * min(count, max(1, order.size // 20)) // order.size
    return stretch


def score(
    columns: Columns,
    seen_by: Sequence[tuple[Array, float]],
    residual: Array,
    critical: float,
    blocks: NDArray[np.intp],
) -> Score:
    """Score one effect at the best of its probes.

    seen_by: for each probe the projected whitened sensitivity and the squared size before the projection; critical: the statistic that
    would count, for the power.
    """
    best: Score | None = None
    left = [float(np.sum((residual - X.sum(axis=1)) ** 2)) for X, _ in seen_by]
    for probe, ((X, whole), change) in enumerate(zip(seen_by, columns.changes, strict=True)):
        gram, total = X.T @ X, X.T @ residual
        coefficient = inverse(gram) @ total
        plain = float(total @ coefficient)
        inflation = inflation_of(X, residual, blocks) if X.any() else 1.0
        moved = coefficient * change
        own = switches(columns.effect)
        plausible = allowed(own, moved)
        seen = float(np.sum(X**2))
        if seen < INVISIBLE * whole or whole == 0.0:
            plausible, seen = False, 0.0  # nuisances or initial states can do exactly the same
        noncentrality = (
            least_seen(X, np.array([p.typical for p in own]) / change) / inflation if seen else 0.0
        )
        found = Score(
            effect=columns.effect.name,
            statistic=plain / inflation if plausible else 0.0,
            freedom=len(change),
            probe=probe,
            nearest=int(np.argmin(left)),
            change=moved,
            power=float(ncx2.sf(critical, len(change), noncentrality)) if noncentrality > 0.0 else 0.0,
            absorbed=max(1.0 - seen / whole, 0.0) if whole > 0.0 else 0.0,
            inflation=inflation,
            direction=X,
            plausible=plausible,
        )
        if best is None or found.statistic > best.statistic:
            best = found
    assert best is not None
    return best


def allowed(parameters: Sequence[Parameter], moved: Array) -> bool:
    """Whether a change is within the bounds, or nearly; of several parameters it is not asked."""
    return len(parameters) > 1 or all(
        p.lower - 0.5 * abs(p.typical) <= p.value + m <= p.upper + 0.5 * abs(p.typical)
        and (not p.whole or abs(m - p.typical) < HALF * abs(p.typical))
        and (np.isinf(p.lower) or p.lower < p.value or m > 0.0)
        for p, m in zip(parameters, moved, strict=True)
    )


def least_seen(direction: Array, typical: Array) -> float:
    """Squared size of the least visible combination of typical changes, (k,) in units of the changes tried; of a long profile, of all together."""
    if typical.size > FEW:
        return float(np.sum(direction**2) * np.mean(typical**2))
    scaled = direction * typical
    return max(float(np.linalg.eigvalsh(scaled.T @ scaled)[0]), 0.0)


def penalty(freedom: int, candidates: int, alpha: float) -> float:
    """What a gain in SSE must exceed: Bonferroni over the candidates, and at least 2 ln(K / alpha)."""
    bonferroni = float(chi2.isf(alpha / candidates, freedom))
    return max(bonferroni, 2.0 * float(np.log(candidates / alpha)) + freedom - 1.0)


def collinearity(one: Array, other: Array) -> float:
    """Cosine of the angle between two spans of projected sensitivities, 0 (told apart at once) to 1 (twins)."""
    if not one.any() or not other.any():
        return 0.0
    Q1, Q2 = np.linalg.qr(one)[0], np.linalg.qr(other)[0]
    return float(np.clip(np.linalg.svd(Q1.T @ Q2, compute_uv=False)[0], 0.0, 1.0))


def by_statistic(scores: Sequence[Score]) -> list[Score]:
    return sorted(scores, key=lambda s: s.p_value if s.statistic > 0 else 2.0)
