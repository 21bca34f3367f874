"""Score (Lagrange multiplier) screen: one simulation per candidate parameter and probe, nuisances projected out.

Statistic, expected change and power after Rao and after Saris, Satorra and Sorbom (1987). Probes are finite changes, so that
lags and friction, whose gradient vanishes at zero, are scored too. Correlation left in the scores, which a
wrong noise model leaves there, is measured over blocks of time and divides the statistic.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, ncx2

from discrepancy.fit import Fit, WindowStates, differences
from discrepancy.model import Effect
from discrepancy.noise import Noise
from discrepancy.problem import Problem, Values
from discrepancy.recording import Array

INVISIBLE = 1e-6  # share of an effect left after projection, below which only rounding is seen
FEW = 3  # parameters; longer profiles are linear and scored at one size
BLOCKS = 30  # of time, for the spread of the scores


@dataclass(frozen=True, slots=True)
class Columns:
    """Raw sensitivities of one effect at its probes: per probe, (N, parameters) in probe units, and the changes tried."""

    effect: Effect
    raw: tuple[Array, ...]
    changes: tuple[Array, ...]  # (parameters,) per probe
    simulations: int


@dataclass(frozen=True, slots=True)
class Score:
    """What the screen says of one effect, all else equal.

    statistic: chi-square with `freedom` degrees when nothing is missing (0 if the change is out of bounds);
    change: expected value of each parameter that is no shape; power: probability to find a typical change;
    absorbed: share of the effect that refitted nuisances could hide; inflation: of the variance of the score.
    """

    effect: str
    statistic: float
    freedom: int
    probe: int
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
    """Parameters that switch the effect on (all but shapes)."""
    return [p.name for p in effect.parameters if not p.shape]


def sensitivities(problem: Problem, values: Values, base: Array, effect: Effect) -> Columns:
    """Simulate the effect at each of its probes, shapes at their typical value."""
    shapes = {p.name: p.value + p.typical for p in effect.parameters if p.shape}
    switches = [p for p in effect.parameters if not p.shape]
    raw, changes = [], []
    probes = max(len(p.tried) for p in switches) if len(switches) <= FEW else 1
    for probe in range(probes):
        tried = {p.name: p.tried[min(probe, len(p.tried) - 1)] for p in switches}
        columns = [
            problem.predict(values.with_shared({**shapes, name: value})) - base
            for name, value in tried.items()
        ]
        raw.append(np.stack(columns, axis=1))
        changes.append(np.array([tried[p.name] - p.value for p in switches]))
    return Columns(effect, tuple(raw), tuple(changes), len(raw) * len(switches))


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

    def off(self, columns: Array) -> Array:
        """(n, k) -> (n, k), orthogonal to what nuisances can do (as far as their priors let them)."""
        free = self.states.off(columns)
        return free - self._columns @ (self._inverse @ (self._columns.T @ free))


def inflation_of(direction: Array, residual: Array, blocks: NDArray[np.intp]) -> float:
    """Variance of the score over its value for white innovations, from sums over blocks of time; at least 1."""
    count = int(blocks.max()) + 1
    if count < 6:
        return 1.0
    norm = np.sqrt(np.sum(direction**2, axis=0))
    norm[norm == 0.0] = 1.0
    X = direction / norm
    clean = residual - X @ np.linalg.lstsq(X, residual, rcond=None)[0]
    sums = np.stack([np.bincount(blocks, x * clean, count) for x in X.T], axis=1)
    # innovations have variance 1 by construction; leverage takes 1/count of the spread away
    spread = np.sum(sums**2, axis=0) * count / (count - 1)
    return max(1.0, float(np.mean(spread)))


def time_blocks(noise: Noise, count: int = BLOCKS) -> NDArray[np.intp]:
    """Number of the stretch of time each whitened row belongs to, about `count` of equal size."""
    order = np.lexsort((noise.row_time, noise.row_window))
    stretch = np.empty(order.size, np.intp)
    stretch[order] = np.arange(order.size) * min(count, max(1, order.size // 20)) // order.size
    return stretch


def score(
    noise: Noise,
    projector: Projector,
    residual: Array,
    columns: Columns,
    critical: float,
    blocks: NDArray[np.intp],
) -> Score:
    """Score one effect at the best of its probes; `critical` is the statistic that would count, for the power."""
    best: Score | None = None
    for probe, (raw, change) in enumerate(zip(columns.raw, columns.changes, strict=True)):
        white = projector.states.off(noise.whiten(raw))
        X = projector.off(white)
        gram, total = X.T @ X, X.T @ residual
        coefficient = np.linalg.pinv(gram, rcond=1e-10) @ total
        plain = float(total @ coefficient)
        inflation = inflation_of(X, residual, blocks) if X.any() else 1.0
        moved = coefficient * change
        switches = [p for p in columns.effect.parameters if not p.shape]
        plausible = (
            all(
                p.lower - 0.5 * abs(p.typical) <= p.value + m <= p.upper + 0.5 * abs(p.typical)
                and (np.isinf(p.lower) or p.lower < p.value or m > 0.0)
                for p, m in zip(switches, moved, strict=True)
            )
            or len(switches) > 1
        )
        seen, whole = float(np.sum(X**2)), float(np.sum(noise.whiten(raw) ** 2))
        if seen < INVISIBLE * whole or whole == 0.0:
            plausible, seen = False, 0.0  # nuisances or initial states can do exactly the same
        typical = np.array([p.typical for p in switches])
        noncentrality = seen * float(np.mean((typical / change) ** 2)) / inflation
        found = Score(
            effect=columns.effect.name,
            statistic=plain / inflation if plausible else 0.0,
            freedom=len(change),
            probe=probe,
            change=moved,
            power=float(ncx2.sf(critical, len(change), max(noncentrality, 1e-9))),
            absorbed=1.0 - seen / whole if whole > 0.0 else 0.0,
            inflation=inflation,
            direction=X,
            plausible=plausible,
        )
        if best is None or found.statistic > best.statistic:
            best = found
    assert best is not None
    return best


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
