"""Maximum likelihood of a tyre's unknowns: bounded trust region, coloured noise, robust weights, and intervals.

A QR factorisation compresses every run to as many rows as it has unknowns, plus one. The trust region then solves a problem with the same
cost, gradient and normal matrix, but with a few hundred rows instead of many thousand. Noise (autoregression, whitening) and inverses of
normal matrices are those of the discrepancy engine.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from discrepancy.estimation.autoregression import Whitener, autoregression
from discrepancy.estimation.normal_equations import inverse, undetermined
from discrepancy.model.windows import Block
from identify.ends import NORMAL_95, ProfileInterval
from identify.tyre.rig_problem import Part, Unknown

Array = NDArray[np.float64]

HUBER = 3.0  # standard deviations beyond which a residual counts in proportion, not squared
ROUNDS = 3  # of noise and weights, each with a fit
FREE = 0.05  # share of an unknown in a direction of which nothing is known, from which it counts as free
BLOCK = 100  # rows that the bootstrap keeps together: one second, longer than the memory of the noise


class Problem(Protocol):
    """Residuals by part, with what is unknown."""

    @property
    def unknowns(self) -> list[Unknown]: ...

    def parts(self, values: Mapping[str, float]) -> Sequence[Part]: ...

    def held_at(self, values: Mapping[str, float]) -> "Problem":
        """The problem with everything that a fit must not change (gains of a predictor) computed at these values."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """An estimate with its standard deviation and 95 % interval."""

    value: float
    sd: float
    lower: float
    upper: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """The unknowns at maximum likelihood."""

    names: tuple[str, ...]
    values: Mapping[str, float]
    sse: float  # of whitened residuals, without priors
    rows: int  # that count
    information: Array  # normal matrix with priors (k, k)
    of_data: Array  # information without priors (k, k)
    scores: Array  # of blocks of rows (blocks, k), for the bootstrap
    at_bound: tuple[str, ...]
    downweighted: int  # rows whose weight is reduced as outliers
    noise_order: int  # of the autoregression
    evaluations: int  # of the model
    noise: "Noise"
    ranges: Mapping[str, float]  # standard deviation of what the bounds of each unknown alone say
    profiled: Mapping[str, ProfileInterval] = field(default_factory=dict)  # in place of linearised intervals
    inflation: float = 1.0  # of the variance, for errors that rows share beyond the noise's memory

    @property
    def covariance(self) -> Array:
        """(k, k)."""
        return inverse(self._normal)

    @property
    def _normal(self) -> Array:
        # what is shared inflates the data's part alone, not what a certificate says
        return np.asarray(self.of_data / self.scatter + (self.information - self.of_data), float)

    @property
    def free(self) -> frozenset[str]:
        """Unknowns that can change together without any first-order effect on the data: their linearised intervals mean nothing."""
        share = np.abs(undetermined(self._normal))
        return frozenset(n for n, row in zip(self.names, share, strict=True) if np.any(row > FREE))

    @property
    def scatter(self) -> float:
        """Variance of the data's residuals over the noise's."""
        return max(1.0, self.sse / max(self.rows - len(self.names), 1)) * self.inflation

    def by(self, name: str) -> str:
        """What an interval follows from."""
        if name in self.profiled:
            return "likelihood"
        return "bounds" if name in self.free else "linearised"

    def interval(self, name: str) -> Interval:
        """By the curvature of the likelihood; by the likelihood itself where it was profiled; by the bounds where neither says anything."""
        value = self.values[name]
        if name in self.profiled:
            p = self.profiled[name]
            sd = (p.upper - p.lower) / (2.0 * NORMAL_95)
            return Interval(value=value, sd=sd, lower=p.lower, upper=p.upper)
        i = self.names.index(name)
        sd = self.ranges[name] if name in self.free else float(np.sqrt(self.covariance[i, i]))
        return Interval(value=value, sd=sd, lower=value - NORMAL_95 * sd, upper=value + NORMAL_95 * sd)

    def derived(self, value: float, gradient: Mapping[str, float]) -> Interval:
        """Interval of a function of the unknowns, from its gradient."""
        g = np.array([gradient.get(name, 0.0) for name in self.names])
        sd = float(np.sqrt(max(0.0, g @ self.covariance @ g)))
        return Interval(value=value, sd=sd, lower=value - NORMAL_95 * sd, upper=value + NORMAL_95 * sd)

    def bootstrap_sd(self, name: str, random: np.random.Generator, draws: int = 400) -> float:
        """Standard deviation from a block bootstrap, as the spread of one Newton step. It needs no model of the noise."""
        # Random signs instead of resampled blocks (wild bootstrap): the scores sum to zero at the optimum, so both spread alike.
        i = self.names.index(name)
        signs = random.choice([-1.0, 1.0], (draws, self.scores.shape[0]))
        return float(np.std((signs @ self.scores) @ inverse(self.information)[:, i]))


@dataclass(frozen=True, slots=True)
class Noise:
    """Whitener and robust weights of each part."""

    whiteners: Sequence[Whitener]
    weights: Sequence[Array]


def estimate(
    problem: Problem,
    start: Mapping[str, float] | None = None,
    *,
    rounds: int = ROUNDS,
    noise: Noise | None = None,
    white: bool = False,
) -> Estimate:
    """The fit of all unknowns. start: initial values by name; noise: of another fit, then kept; white: no autoregression."""
    unknowns = problem.unknowns
    x = np.array([(start or {}).get(u.name, u.start) for u in unknowns])
    low, high = np.array([u.lower for u in unknowns]), np.array([u.upper for u in unknowns])
    x = np.clip(x, low + 1e-9 * (high - low), high - 1e-9 * (high - low))
    names, calls = [u.name for u in unknowns], 0
    known = noise
    # noise and fit depend on each other: each round estimates the noise at the fit of the one before
    for _ in range(rounds if noise is None else 1):
        values = dict(zip(names, x.tolist(), strict=True))
        problem = problem.held_at(values)
        known = noise or _noise(problem.parts(values), None if white else known, len(names))
        fun = Compressed(problem, unknowns, known)
        found = least_squares(
            fun.residual,
            x,
            fun.jacobian,
            bounds=(low, high),
            x_scale=[u.typical for u in unknowns],
            xtol=1e-7,
            ftol=1e-9,
            gtol=1e-12,
            max_nfev=60,
        )
        x, calls = found.x, calls + fun.calls
    assert known is not None
    return _result(problem, unknowns, x, known, calls, (low, high))


class Compressed:
    """The whitened, compressed problem for scipy: residual and Jacobian, computed together and kept for the second call."""

    def __init__(self, problem: Problem, unknowns: Sequence[Unknown], noise: Noise) -> None:
        self._problem, self._unknowns, self._noise = problem, unknowns, noise
        self._at: Array | None = None
        self._last: tuple[Array, Array] = (np.zeros(0), np.zeros((0, 0)))
        self.calls = 0

    def residual(self, x: Array) -> Array:
        return self._of(x)[0]

    def jacobian(self, x: Array) -> Array:
        return self._of(x)[1]

    def _of(self, x: Array) -> tuple[Array, Array]:
        if self._at is None or not np.array_equal(x, self._at):
            self.calls += 1
            values = {u.name: float(v) for u, v in zip(self._unknowns, x, strict=True)}
            rows, columns = _prior_rows(self._unknowns, x)
            residuals, jacobians = [rows], [columns]
            parts = self._problem.parts(values)
            for part, white in zip(parts, _whitened(parts, self._noise), strict=True):
                # R of [J e] has the same products J'J, J'e and e'e as the full matrix: all that a least-squares step needs
                triangle: Array = np.asarray(np.linalg.qr(white, mode="r"))
                wide = np.zeros((triangle.shape[0], len(self._unknowns)))
                wide[:, part.columns] = triangle[:, :-1] @ part.to
                residuals.append(triangle[:, -1])
                jacobians.append(wide)
            self._at, self._last = x.copy(), (np.concatenate(residuals), np.concatenate(jacobians))
        return self._last


def _prior_rows(unknowns: Sequence[Unknown], x: Array) -> tuple[Array, Array]:
    known = [(i, u.prior, u.prior_sd) for i, u in enumerate(unknowns) if u.prior_sd]
    rows, J = np.zeros(len(known)), np.zeros((len(known), len(unknowns)))
    for k, (i, mean, sd) in enumerate(known):
        rows[k], J[k, i] = (x[i] - mean) / sd, 1.0 / sd
    return rows, J


def _whitened(parts: Sequence[Part], noise: Noise) -> list[Array]:
    """Derivatives and, last, the residual of each part (n, m + 1), white and weighted; rows that touch a rejected sample are 0."""
    out = []
    for part, whitener, weight in zip(parts, noise.whiteners, noise.weights, strict=True):
        rows = np.concatenate([part.by, part.residual[:, None]], axis=1)
        out.append(whitener.apply(rows[:, None, :])[:, 0, :] * weight[:, None])
    return out


def prior_cost(unknowns: Sequence[Unknown], values: Mapping[str, float]) -> float:
    """What the priors add to the sum of squares."""
    return sum(((values[u.name] - u.prior) / u.prior_sd) ** 2 for u in unknowns if u.prior_sd)


def _noise(parts: Sequence[Part], before: Noise | None, used: int) -> Noise:
    """Autoregression of all residuals together, and Huber's weights of what it leaves."""
    series = [_bridged(part) for part in parts]
    start, blocks = 0, list[Block]()
    for values in series:
        blocks.append(Block(0, 0, ("force",), np.arange(values.size, dtype=float), start))
        start += values.size
    rows = np.concatenate(series)
    if before is None:  # far from the optimum the misfit is no noise process: take only its size, robustly
        size = 1.4826 * float(np.median(np.abs(rows - np.median(rows)))) + 1e-9
        whitener = Whitener(np.zeros((0, 1, 1)), np.array([[1.0 / size]]))
    else:
        whitener = autoregression(blocks, rows, rows.size / max(rows.size - used, 1), np.zeros(1))
    weights = []
    for part, values in zip(parts, series, strict=True):
        if before is None:  # robust weights at a wrong curve would protect that curve
            weights.append(part.kept.astype(float))
            continue
        e = np.abs(whitener.apply(values[:, None, None])[:, 0, 0])
        touched = ~part.kept
        clean = np.ones(e.size, bool)
        for lag in range(whitener.order + 1):
            clean &= ~touched[whitener.order - lag : touched.size - lag]
        weights.append(np.where(clean, np.sqrt(np.minimum(1.0, HUBER / np.maximum(e, 1e-12))), 0.0))
    return Noise([whitener] * len(parts), weights)


def _bridged(part: Part) -> Array:
    """The residual with rejected samples interpolated, so that an autoregression can run over them."""
    if part.kept.all():
        return part.residual
    index = np.arange(part.residual.size)
    return np.interp(index, index[part.kept], part.residual[part.kept])


def _result(
    problem: Problem,
    unknowns: Sequence[Unknown],
    x: Array,
    noise: Noise,
    calls: int,
    edges: tuple[Array, Array],
) -> Estimate:
    k = len(unknowns)
    values = {u.name: float(v) for u, v in zip(unknowns, x, strict=True)}
    information, rows, sse, scores = np.zeros((k, k)), 0, 0.0, []
    parts = problem.parts(values)
    for part, white in zip(parts, _whitened(parts, noise), strict=True):
        e, J = white[:, -1], white[:, :-1]
        information[np.ix_(part.columns, part.columns)] += part.to.T @ (J.T @ J) @ part.to
        rows += int(np.count_nonzero(np.any(J != 0.0, axis=1)))
        sse += float(e @ e)
        for at in range(0, e.size, BLOCK):
            score = np.zeros(k)
            score[part.columns] = part.to.T @ (J[at : at + BLOCK].T @ e[at : at + BLOCK])
            scores.append(score)
    priors = np.array([1.0 / u.prior_sd**2 if u.prior_sd else 0.0 for u in unknowns])
    low, high = edges
    near = 1e-6 * (high - low)
    return Estimate(
        names=tuple(values),
        values=values,
        sse=sse,
        rows=rows,
        information=information + np.diag(priors),
        of_data=information,
        scores=np.array(scores),
        at_bound=tuple(
            u.name for i, u in enumerate(unknowns) if x[i] - low[i] < near[i] or high[i] - x[i] < near[i]
        ),
        downweighted=int(sum(np.count_nonzero((w > 0.0) & (w < 1.0)) for w in noise.weights)),
        noise_order=noise.whiteners[0].order if noise.whiteners else 0,
        evaluations=calls,
        noise=noise,
        ranges={u.name: (u.upper - u.lower) / 12.0**0.5 for u in unknowns},
    )
