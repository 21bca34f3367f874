"""Generalised least squares with bounds and priors: Gauss-Newton steps, with the initial states of every window projected out.

All rows are whitened, so that a difference of SSE is twice a difference of log-likelihoods. Initial states are projected out because there
are few per window but many in all: the normal matrix stays as small as the number of shared parameters (variable projection).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from discrepancy.estimation.effort import FULL, Effort
from discrepancy.estimation.noise import Noise, estimate_noise
from discrepancy.estimation.normal_equations import inverse
from discrepancy.estimation.problem import Problem, Values
from discrepancy.model.description import Parameter
from discrepancy.signals.recording import Array

Mask = NDArray[np.bool_]
# In typical changes. A thousandth keeps the curvature small and the difference far above the rounding of a simulation.
STEP = 1e-3
FORECAST = 0.02  # error of the linear forecast, as a share of a step's reduction, up to which the step counts as linear
KEPT_PROMISE = 0.5  # share of the forecast reduction above which cached columns are good enough
BEND = 3.0  # increase of a window's SSE above which the step of its own initial states is shortened; and what their guess has to be better by
SHRINKS = (
    1.0,
    0.4,
    0.1,
)  # shares of a step that are tried in turn; with cached columns only the first: if it fails, new columns help more
NOTHING = 1e-8  # of the longest column of an initial state, or of the largest singular value: what is below it is rounding
CONVERGED = 1e-2  # of the SSE; thresholds are 6 and more
STATES_ONLY = Effort(
    iterations=2
)  # outputs depend nearly linearly on initial states, so two steps are enough


@dataclass(frozen=True, slots=True)
class Fit:
    """A fitted problem. Residual and columns are whitened, with initial states projected out."""

    names: tuple[str, ...]  # fitted shared parameters
    values: Values
    sse: float  # squared whitened residuals and squared deviations from the priors
    data_sse: float  # squared whitened residuals alone
    residual: Array  # (n,)
    columns: Array  # derivative by each of `names` (n, k)
    information: Array  # normal matrix of `names` with priors (k, k)

    def sd(self, name: str) -> float:
        """Standard deviation of a fitted parameter; 0 where the data contain no information on it."""
        return float(np.sqrt(self.covariance[self.names.index(name), self.names.index(name)]))

    @property
    def covariance(self) -> Array:
        """Covariance (k, k) of `names`, by linearisation."""
        return inverse(self.information)


class WindowStates:
    """Removes from whitened rows the part that initial states of their window can produce; fitted on the rows of a mask only."""

    def __init__(self, local: Array, row_window: NDArray[np.intp], rows: Mask) -> None:
        self._local, self.used = local, 0
        self._parts: list[tuple[NDArray[np.intp], Array, Array]] = []
        if local.shape[1] == 0:
            return
        chosen = np.flatnonzero(rows)
        edges = np.flatnonzero(np.diff(row_window[chosen])) + 1
        parts = [part for part in np.split(chosen, edges) if part.size]
        # pascals beside metres are eight powers of ten apart: only columns of one length can be compared
        lengths = [np.linalg.norm(local[part], axis=0) for part in parts]
        longest = np.max(lengths, axis=0, initial=0.0)
        for part, length in zip(parts, lengths, strict=True):
            acting = np.flatnonzero(length > NOTHING * longest)
            if not acting.size:
                continue
            # SVD instead of normal equations: two states may act alike in a short window (position and bias), and the direction
            # without influence must be left out rather than divided by nearly zero
            U, s, Vt = np.linalg.svd(local[np.ix_(part, acting)] / length[acting], full_matrices=False)
            sound = s > NOTHING * s[0]
            back = np.zeros((local.shape[1], int(np.count_nonzero(sound))))
            back[acting] = Vt[sound].T / s[sound] / length[acting, None]
            self._parts.append((part, U[:, sound], back))
            self.used += back.shape[1]

    def off(self, rows: Array) -> Array:
        """The rows minus the part that initial states can produce; rows outside the mask are unchanged."""
        out = rows.copy()
        for part, U, _ in self._parts:
            out[part] -= U @ (U.T @ rows[part])
        return out

    def solve(self, rows: Array, count: int, row_window: NDArray[np.intp]) -> Array:
        """Changes of the initial states (windows, states) that reproduce the rows best, in least squares."""
        change = np.zeros((count, self._local.shape[1]))
        for part, U, back in self._parts:
            change[row_window[part[0]]] = back @ (U.T @ rows[part])
        return change


def differences(
    problem: Problem,
    values: Values,
    base: Array,
    names: Sequence[str],
    *,
    cached: bool = False,
    backward: bool = False,
) -> Array:
    """Derivatives of the raw rows by parameters (N, k). cached: columns that were kept at any other point may be used.

    backward: parameters whose step is a step of the grid are stepped the other way.
    """
    turned = {name for name in names if backward and _steps_by_grid(problem, name)}
    # A parameter of single windows is stepped in all windows at once, since no window depends on another: one simulation is enough.
    found = {
        name: None if name in turned else problem.jacobian.column(name, None, values.shared, anywhere=cached)
        for name in names
    }
    new = [name for name, column in found.items() if column is None]
    steps = {name: _difference(problem, values, name, backward=name in turned) for name in new}
    rows = problem.predict_each([_stepped(problem, values, name, step) for name, step in steps.items()])
    for (name, step), moved in zip(steps.items(), rows, strict=True):
        found[name] = column = (moved - base) / step
        if name not in turned:
            problem.jacobian.keep(name, None, values.shared, column)
    columns = [column for column in found.values() if column is not None]
    return np.stack(columns, axis=1) if columns else np.zeros((base.size, 0))


def initial_uncertainty(problem: Problem, values: Values, base: Array, *, cached: bool = False) -> Array:
    """Changes of the raw rows (N, k) by one prior standard deviation of each initial state that is not fitted; cached: as in `differences`."""
    names = problem.initial_uncertainty_names
    sds = [problem.model.parameter(name).prior_sd or 0.0 for name in names]
    return np.asarray(differences(problem, values, base, names, cached=cached) * np.array(sds), float)


def _difference(problem: Problem, values: Values, name: str, *, backward: bool = False) -> float:
    """Step of a finite difference in the parameter's unit, within its bounds; negative for a negative typical change, and backward."""
    parameter = problem.model.parameter(name)
    # a delay below one step of the grid only tests the interpolation, which has kinks at the samples
    step = problem.model.step_s if _steps_by_grid(problem, name) else STEP * parameter.typical
    step = -step if backward else step
    if parameter.scope == "all" and not parameter.lower <= values.shared[name] + step <= parameter.upper:
        return -step
    return step


def _steps_by_grid(problem: Problem, name: str) -> bool:
    """Whether the finite difference of a parameter is a step of the model's grid."""
    parameter = problem.model.parameter(name)
    return parameter.unit == "s" and STEP * parameter.typical < problem.model.step_s


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
    effort: Effort = FULL,
) -> Fit:
    """The fit of shared parameters `names` and all initial states to the whitened rows of a mask (None: all rows)."""
    rows = np.ones(noise.keep.size, bool) if rows is None else rows
    parameters = [problem.model.parameter(name) for name in names]
    # Steps are in typical changes, so that pascals and metres have similar columns. A prior is one more row per parameter.
    scale = np.array([p.typical for p in parameters])
    prior = np.array([p.typical / p.prior_sd if p.prior_sd else 0.0 for p in parameters])
    borrowed = cached = effort.cached and problem.model.costly
    chord = effort.chord and borrowed
    if effort.iterations and problem.local_names:
        e = noise.whiten(problem.measured - problem.predict(start))
        start, _ = _guessed_where_better(problem, noise, start, e, rows)
    point = _Point.at(problem, noise, parameters, start, rows, cached)
    turned = not any(_steps_by_grid(problem, name) for name in names)
    for later in reversed(range(effort.iterations)):
        # the linear problem in the shared parameters alone: initial states are already projected out of its columns
        A = np.concatenate([point.columns[rows] * scale, np.diag(prior)])
        b = np.concatenate([point.residual[rows], -prior * point.deviation])
        step = _bounded(A, b, parameters, point.values)
        # the initial states follow the shared step: they are solved for what it leaves of the unprojected residual
        left = point.white - point.white_columns @ (step * scale)
        local_step = point.states.solve(left, len(problem.windows), noise.row_window)
        before, promised = point.sse, float(np.sum((b - A @ step) ** 2))
        if effort.least_reduction > 0.0 and before - promised < effort.least_reduction:
            break
        worth = before - promised > CONVERGED
        tried = (
            _with_local_steps(problem, noise, point, shrink * step * scale, local_step, shrink, rows)
            for shrink in (SHRINKS[:1] if cached else SHRINKS)
        )
        better = next(((v, sse) for v, sse in tried if sse < before), None) if worth else None
        if better is None and cached and later and not chord:
            # the columns of another point led to no improvement here: compute those of this point
            cached, point = False, _Point.at(problem, noise, parameters, point.values, rows)
            continue
        if better is None and worth and later and not turned:
            # at a kink the slope towards larger values may promise what only smaller ones keep
            turned = True
            point = _Point.at(problem, noise, parameters, point.values, rows, backward=True)
            continue
        if better is None:
            break
        moved, sse = better
        # while the linear forecast is right, the columns are still right: keep them and save simulations (chord method)
        linear = abs(sse - promised) < FORECAST * (before - sse) + CONVERGED
        cached = cached and (chord or before - sse > KEPT_PROMISE * (before - promised))
        last = before - sse < CONVERGED or (borrowed and not later)
        point = (
            point.renewed(problem, noise, moved, rows)
            if linear or last or chord
            else _Point.at(problem, noise, parameters, moved, rows, cached)
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
    """The values after a shared step and its SSE; every window takes that share of its own local step that fits it best."""
    # Shares are chosen per window: with one share for all, a single window with a stop or a contact, where the model is not linear,
    # would shorten the steps of all others.
    count = len(problem.windows)
    old = _per_window(point.white, noise, rows, count)
    best, least = np.zeros_like(local_step), np.full(count, np.inf)
    for part in (shrink, 0.3 * shrink, 0.0):
        values = _moved(problem, point.values, point.parameters, step, part * local_step)
        e = noise.whiten(problem.measured - problem.predict(values))
        now = _per_window(e, noise, rows, count)
        if not problem.local_names or np.all(now <= old + BEND):
            break
        better = now < least
        best[better], least[better] = part * local_step[better], now[better]
    else:
        values = _moved(problem, point.values, point.parameters, step, best)
        e = noise.whiten(problem.measured - problem.predict(values))
    values, e = _guessed_where_better(problem, noise, values, e, rows)
    return values, _sse(e, point.parameters, values, rows)


def _guessed_where_better(
    problem: Problem, noise: Noise, values: Values, e: Array, rows: Mask
) -> tuple[Values, Array]:
    """The values with the guessed initial states in every window that these fit clearly better, and their whitened residual; e: that of the values."""
    # Initial states that stood in for a force which was not yet in the model may lie in a minimum of their own once it is: a start with
    # speed, say, that dry friction then stops. No step of least squares leads out of it.
    if not problem.local_names:
        return values, e
    guessed = values.starting_as(problem.guesses)
    other = noise.whiten(problem.measured - problem.predict(guessed))
    count = len(problem.windows)
    better = _per_window(other, noise, rows, count) < _per_window(e, noise, rows, count) - BEND
    if not better.any():
        return values, e
    mixed = {name: np.where(better, guessed.local[name], states) for name, states in values.local.items()}
    # no window depends on another
    return values.starting_as(mixed), np.where(better[noise.row_window], other, e)


def _per_window(e: Array, noise: Noise, rows: Mask, count: int) -> Array:
    """SSE of every window (count,)."""
    return np.asarray(np.bincount(noise.row_window[rows], e[rows] ** 2, count), float)


@dataclass(frozen=True, slots=True)
class _Point:
    """The problem linearised at some values."""

    parameters: tuple[Parameter, ...]
    values: Values
    sse: float  # with priors
    white: Array  # whitened residual (n,)
    white_columns: Array  # whitened derivatives (n, k)
    states: WindowStates
    residual: Array  # `white` with initial states projected out
    columns: Array  # `white_columns` with initial states projected out

    @classmethod
    def at(
        cls,
        problem: Problem,
        noise: Noise,
        parameters: Sequence[Parameter],
        values: Values,
        rows: Mask,
        cached: bool = False,
        backward: bool = False,
    ) -> "_Point":
        base = problem.predict(values)
        names = [p.name for p in parameters]
        raw = differences(
            problem, values, base, [*names, *problem.local_names], cached=cached, backward=backward
        )
        moved = noise.whiten(raw)
        J, L = moved[:, : len(names)], moved[:, len(names) :]
        e = noise.whiten(problem.measured - base)
        states = WindowStates(L, noise.row_window, rows)
        sse = _sse(e, parameters, values, rows)
        return cls(tuple(parameters), values, sse, e, J, states, states.off(e), states.off(J))

    def renewed(self, problem: Problem, noise: Noise, values: Values, rows: Mask) -> "_Point":
        """The residual at new values, with the derivatives of this point."""
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


def held_out(problem: Problem, noise: Noise, values: Values, rows: Mask) -> Fit:
    """The fit of the initial states alone to `rows`, with shared parameters as given: the error of rows that they were not fitted to."""
    return fit(problem, noise, (), values, rows=rows, effort=STATES_ONLY)


def log_likelihood(problem: Problem, noise: Noise, fitted: Fit) -> float:
    """Twice the log-likelihood of a fit under the noise that it leaves, up to a constant; noise: under which it was fitted."""
    raw = problem.measured - problem.predict(fitted.values)
    left = estimate_noise(problem, raw, len(fitted.names), noise)
    return 2.0 * left.log_density() - float(np.sum(left.whiten(raw) ** 2))


def _bounded(A: Array, b: Array, parameters: Sequence[Parameter], values: Values) -> Array:
    """The step (k,) in typical changes that solves A x = b in least squares within the bounds."""
    if not parameters:
        return np.zeros(0)
    now = np.array([values.shared[p.name] for p in parameters])
    scale = np.array([p.typical for p in parameters])
    edges = np.array([[p.lower, p.upper] for p in parameters])
    # sorted: dividing by a negative typical change exchanges the two bounds
    low, high = np.sort((edges - now[:, None]) / scale[:, None], axis=1).T
    size = np.sqrt(np.sum(A**2, axis=0)) + 1e-12
    tiny = 1e-9 * np.diag(size)  # a parameter without influence stays where it is
    solved = lsq_linear(
        np.concatenate([A, tiny]),
        np.concatenate([b, np.zeros(len(parameters))]),
        # lsq_linear requires low < high, also for a parameter that stands on its bound
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
