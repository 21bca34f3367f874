"""Generalised least squares with bounds and priors, initial states of every window projected out (Gauss-Newton).

All in whitened units: an SSE difference is twice a difference of log-likelihoods.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from discrepancy.model import Parameter
from discrepancy.noise import Noise
from discrepancy.normal import inverse
from discrepancy.problem import Problem, Values
from discrepancy.recording import Array

Mask = NDArray[np.bool_]
STEP = 1e-3  # finite differences, in typical changes
FORECAST = (
    0.02  # share of a step's gain by which a linear forecast may be wrong and the step still count as linear
)
KEPT_PROMISE = 0.5  # share of a forecast gain that shows sensitivities of elsewhere to be good enough
BEND = 3.0  # of whitened SSE, by which a window may become worse before its own step is shortened
SHRINKS = (1.0, 0.4, 0.1)  # of a step, in turn; with borrowed sensitivities the first only
CONVERGED = 1e-2  # in whitened SSE: a hundredth of what matters statistically


@dataclass(frozen=True, slots=True)
class Fit:
    """A fitted problem. sse includes the priors; residual and columns are whitened with initial states projected out.

    columns: derivative by each of `names` (n, k); information: their normal matrix with priors (k, k).
    """

    names: tuple[str, ...]
    values: Values
    sse: float
    data_sse: float
    residual: Array
    columns: Array
    information: Array

    def sd(self, name: str) -> float:
        """Standard deviation of a fitted parameter; 0 where nothing tells of it."""
        return float(np.sqrt(self.covariance[self.names.index(name), self.names.index(name)]))

    @property
    def covariance(self) -> Array:
        return inverse(self.information)


class WindowStates:
    """Projection off the initial states of every window, for the rows of a mask."""

    def __init__(self, local: Array, row_window: NDArray[np.intp], rows: Mask) -> None:
        self._local, self.used = local, 0
        self._parts: list[tuple[NDArray[np.intp], Array, Array]] = []
        if local.shape[1] == 0:
            return
        chosen = np.flatnonzero(rows)
        edges = np.flatnonzero(np.diff(row_window[chosen])) + 1
        for part in np.split(chosen, edges):
            if part.size:
                U, s, Vt = np.linalg.svd(local[part], full_matrices=False)
                sound = s > 1e-8 * max(float(s[0]), 1e-300)
                self._parts.append((part, U[:, sound], (Vt[sound].T / s[sound])))
                self.used += int(np.count_nonzero(sound))

    def off(self, rows: Array) -> Array:
        """rows minus what initial states can explain; rows outside the mask are left."""
        out = rows.copy()
        for part, U, _ in self._parts:
            out[part] -= U @ (U.T @ rows[part])
        return out

    def solve(self, rows: Array, count: int, row_window: NDArray[np.intp]) -> Array:
        """Changes of the initial states (windows, states) that explain rows best."""
        change = np.zeros((count, self._local.shape[1]))
        for part, U, back in self._parts:
            change[row_window[part[0]]] = back @ (U.T @ rows[part])
        return change


def differences(
    problem: Problem, values: Values, base: Array, names: Sequence[str], *, rough: bool = False
) -> Array:
    """Derivative of the raw rows by parameters (N, k); for local ones in all windows at once. rough: or what it was elsewhere, if that is kept."""
    found = {name: problem.kept_slope(name, None, values, anywhere=rough) for name in names}
    new = [name for name, column in found.items() if column is None]
    steps = {name: _difference(problem, values, name) for name in new}
    rows = problem.predict_each([_stepped(problem, values, name, step) for name, step in steps.items()])
    for (name, step), moved in zip(steps.items(), rows, strict=True):
        found[name] = column = (moved - base) / step
        problem.keep_slope(name, None, values, column)
    columns = [column for column in found.values() if column is not None]
    return np.stack(columns, axis=1) if columns else np.zeros((base.size, 0))


def begins(problem: Problem, values: Values, base: Array, *, rough: bool = False) -> Array:
    """Raw rows (N, k) of one standard deviation of each state in which windows begin and that is not known exactly; rough: as in `fit`."""
    sds = [problem.model.parameter(name).prior_sd or 0.0 for name in problem.begin_names]
    return np.asarray(
        differences(problem, values, base, problem.begin_names, rough=rough) * np.array(sds), float
    )


def _difference(problem: Problem, values: Values, name: str) -> float:
    """Step of a finite difference that stays within the bounds; that of a parameter with a negative typical value is negative."""
    parameter = problem.model.parameter(name)
    step = STEP * parameter.typical
    if parameter.unit == "s":  # below its grid a model knows of times only what interpolation makes up
        step = max(step, problem.model.step_s)
    if parameter.scope == "all" and not parameter.lower <= values.shared[name] + step <= parameter.upper:
        return -step
    return step


def _stepped(problem: Problem, values: Values, name: str, step: float) -> Values:
    if problem.model.parameter(name).scope == "window":
        return replace(values, local={**values.local, name: values.local[name] + step})
    return values.with_shared({name: values.shared[name] + step})


def fit(
    problem: Problem,
    noise: Noise,
    names: Sequence[str],
    start: Values,
    *,
    rows: Mask | None = None,
    iterations: int = 8,
    rough: bool = False,
    enough: float | None = None,
    chord: bool = False,
) -> Fit:
    """Fit shared parameters `names` and all initial states to the whitened rows of a mask (all, if None).

    rough: sensitivities that a costly model has had elsewhere serve while steps keep what they promise; they are in the result. enough: gain
    in SSE that is not worth a step. chord: a costly model's sensitivities are never computed anew, whatever the steps keep.
    """
    rows = np.ones(noise.keep.size, bool) if rows is None else rows
    parameters = [problem.model.parameter(name) for name in names]
    scale = np.array([p.typical for p in parameters])
    prior = np.array([p.typical / p.prior_sd if p.prior_sd else 0.0 for p in parameters])
    point = _Point.at(problem, noise, parameters, start, rows, rough)
    borrowed = rough = rough and problem.model.costly
    chord = chord and borrowed
    for later in reversed(range(iterations)):
        A = np.concatenate([point.columns[rows] * scale, np.diag(prior)])
        b = np.concatenate([point.residual[rows], -prior * point.deviation])
        step = _bounded(A, b, parameters, point.values)
        left = point.white - point.white_columns @ (step * scale)
        local_step = point.states.solve(left, len(problem.windows), noise.row_window)
        before, promised = point.sse, float(np.sum((b - A @ step) ** 2))
        if enough is not None and before - promised < enough:
            break
        worth = before - promised > CONVERGED
        tried = (
            _with_local_steps(problem, noise, point, shrink * step * scale, local_step, shrink, rows)
            for shrink in (SHRINKS[:1] if rough else SHRINKS)
        )
        better = next(((v, sse) for v, sse in tried if sse < before), None) if worth else None
        if better is None and rough and later and not chord:
            rough, point = False, _Point.at(problem, noise, parameters, point.values, rows)
            continue
        if better is None:
            break
        moved, sse = better
        # where the linear forecast held, the sensitivities still do (chord method)
        linear = abs(sse - promised) < FORECAST * (before - sse) + CONVERGED
        rough = rough and (chord or before - sse > KEPT_PROMISE * (before - promised))
        last = before - sse < CONVERGED or (borrowed and not later)
        point = (
            point.renewed(problem, noise, moved, rows)
            if linear or last or chord
            else _Point.at(problem, noise, parameters, moved, rows, rough)
        )
        if before - point.sse < CONVERGED:
            break
    information = point.columns[rows].T @ point.columns[rows] + np.diag((prior / scale) ** 2)
    data_sse = float(np.sum(point.residual[rows] ** 2))
    total = data_sse + float(np.sum((prior * point.deviation) ** 2))
    return Fit(tuple(names), point.values, total, data_sse, point.residual, point.columns, information)


def _with_local_steps(
    problem: Problem,
    noise: Noise,
    point: "_Point",
    step: Array,
    local_step: Array,
    shrink: float,
    rows: Mask,
) -> tuple[Values, float]:
    """The shared step, with as much of the local one in each window as does it good, and the SSE there.

    One window in which the model bends (a stop, a contact) would otherwise hold back all.
    """
    count = len(problem.windows)
    old = _per_window(point.white, noise, rows, count)
    best, least = np.zeros_like(local_step), np.full(count, np.inf)
    for part in (shrink, 0.3 * shrink, 0.0):
        values = _moved(problem, point.values, point.parameters, step, part * local_step)
        e = noise.whiten(problem.measured - problem.predict(values))
        now = _per_window(e, noise, rows, count)
        if not problem.local_names or np.all(now <= old + BEND):
            return values, _sse(e, point.parameters, values, rows)
        better = now < least
        best[better], least[better] = part * local_step[better], now[better]
    values = _moved(problem, point.values, point.parameters, step, best)
    return values, _misfit(problem, noise, point.parameters, values, rows)


def _per_window(e: Array, noise: Noise, rows: Mask, count: int) -> Array:
    return np.asarray(np.bincount(noise.row_window[rows], e[rows] ** 2, count), float)


@dataclass(frozen=True, slots=True)
class _Point:
    """The problem linearised at some values; white is the residual before, residual after projection."""

    parameters: tuple[Parameter, ...]
    values: Values
    sse: float
    white: Array
    white_columns: Array
    states: WindowStates
    residual: Array
    columns: Array

    @classmethod
    def at(
        cls,
        problem: Problem,
        noise: Noise,
        parameters: Sequence[Parameter],
        values: Values,
        rows: Mask,
        rough: bool = False,
    ) -> "_Point":
        base = problem.predict(values)
        names = [p.name for p in parameters]
        raw = differences(problem, values, base, [*names, *problem.local_names], rough=rough)
        moved = noise.whiten(raw)
        J, L = moved[:, : len(names)], moved[:, len(names) :]
        e = noise.whiten(problem.measured - base)
        states = WindowStates(L, noise.row_window, rows)
        sse = _sse(e, parameters, values, rows)
        return cls(tuple(parameters), values, sse, e, J, states, states.off(e), states.off(J))

    def renewed(self, problem: Problem, noise: Noise, values: Values, rows: Mask) -> "_Point":
        """The residual at new values, with the sensitivities of the old."""
        e = noise.whiten(problem.measured - problem.predict(values))
        sse = _sse(e, self.parameters, values, rows)
        return replace(self, values=values, sse=sse, white=e, residual=self.states.off(e))

    @property
    def deviation(self) -> Array:
        """Distance of each parameter from its prior mean, in typical changes."""
        return np.array([(self.values.shared[p.name] - p.value) / p.typical for p in self.parameters])


def _sse(e: Array, parameters: Sequence[Parameter], values: Values, rows: Mask) -> float:
    prior = sum(((values.shared[p.name] - p.value) / p.prior_sd) ** 2 for p in parameters if p.prior_sd)
    return float(np.sum(e[rows] ** 2)) + prior


def _misfit(
    problem: Problem, noise: Noise, parameters: Sequence[Parameter], values: Values, rows: Mask
) -> float:
    return _sse(noise.whiten(problem.measured - problem.predict(values)), parameters, values, rows)


def held_out(problem: Problem, noise: Noise, values: Values, rows: Mask) -> Fit:
    """Shared parameters as given; only the initial states are refitted, to `rows`."""
    return fit(problem, noise, (), values, rows=rows, iterations=2)


def _bounded(A: Array, b: Array, parameters: Sequence[Parameter], values: Values) -> Array:
    if not parameters:
        return np.zeros(0)
    now = np.array([values.shared[p.name] for p in parameters])
    scale = np.array([p.typical for p in parameters])
    edges = np.array([[p.lower, p.upper] for p in parameters])
    low, high = np.sort((edges - now[:, None]) / scale[:, None], axis=1).T
    size = np.sqrt(np.sum(A**2, axis=0)) + 1e-12
    tiny = 1e-9 * np.diag(size)  # a parameter without influence stays where it is
    solved = lsq_linear(
        np.concatenate([A, tiny]),
        np.concatenate([b, np.zeros(len(parameters))]),
        bounds=(np.minimum(low, -1e-12), np.maximum(high, 1e-12)),
        tol=1e-8,
    )
    return np.asarray(solved.x, float)


def _moved(
    problem: Problem, values: Values, parameters: Sequence[Parameter], step: Array, local_step: Array
) -> Values:
    shared = {
        p.name: float(np.clip(values.shared[p.name] + change, p.lower, p.upper))
        for p, change in zip(parameters, step, strict=True)
    }
    local = {name: values.local[name] + local_step[:, i] for i, name in enumerate(problem.local_names)}
    return replace(values, shared={**values.shared, **shared}, local=local)
