"""The residual with every candidate of the library projected out, from which noise is estimated.

Noise estimated from the plain residual would contain the missing effect and hide it from the screen.
"""

from collections.abc import Sequence

import numpy as np

from discrepancy.estimation.fit import Fit, WindowStates, differences
from discrepancy.estimation.noise import Noise
from discrepancy.estimation.problem import Problem
from discrepancy.selection.screen import Columns, Projector
from discrepancy.signals.recording import Array


def unexplained(
    problem: Problem, noise: Noise, fitted: Fit, raw: Array, columns: Sequence[Columns]
) -> tuple[Array, float]:
    """Raw residual (N,) with every candidate projected out, and the effective number of parameters that were used for it."""
    # Every trial step is a column, in units of that step, with a prior of five steps: without a prior, a large library would fit a
    # short recording completely and leave no noise.
    all_columns = _stacked(raw, columns)
    projector = Projector(problem, noise, fitted)
    X = projector.off(noise.whiten(all_columns))
    coefficient, used = _weakly(X, fitted.residual)
    left = raw - all_columns @ coefficient
    # nuisances and initial states were fitted with the effects missing; they move when these are projected out
    return _refitted(problem, noise, fitted, left), used + projector.states.used + len(fitted.names)


def unexplained_by_window(
    problem: Problem, noise: Noise, fitted: Fit, raw: Array, columns: Sequence[Columns]
) -> tuple[Array, float]:
    """The same with every candidate free in every window, so that temporary effects are projected out of the noise as well."""
    all_columns = _stacked(raw, columns)
    states = Projector(problem, noise, fitted).states
    X = states.off(noise.whiten(all_columns))
    left, whole = raw.copy(), states.used + len(fitted.names) + 0.0
    for window in range(len(problem.windows)):
        own, rows = noise.row_window == window, problem.row_window == window
        coefficient, used = _weakly(X[own], fitted.residual[own])
        left[rows] -= all_columns[rows] @ coefficient
        whole += used
    return _refitted(problem, noise, fitted, left), whole


def _stacked(raw: Array, columns: Sequence[Columns]) -> Array:
    return np.concatenate([part for c in columns for part in c.raw] or [np.zeros((raw.size, 0))], axis=1)


def _weakly(X: Array, residual: Array) -> tuple[Array, float]:
    """Coefficients of columns (n, k) with a prior standard deviation of 5 each, and their effective number (trace of the ridge hat matrix)."""
    gram = X.T @ X
    weak = gram + np.eye(len(gram)) / 5.0**2
    if not len(gram):
        return np.zeros(0), 0.0
    found = np.asarray(np.linalg.solve(weak, X.T @ residual), float)
    return found, float(np.trace(np.linalg.solve(weak, gram)))


def _refitted(problem: Problem, noise: Noise, fitted: Fit, left: Array) -> Array:
    """The residual (N,) after a linear refit of nuisances and initial states."""
    base = problem.predict(fitted.values)
    raw = differences(problem, fitted.values, base, [*fitted.names, *problem.local_names], cached=True)
    J, L = raw[:, : len(fitted.names)], raw[:, len(fitted.names) :]
    white = noise.whiten(left)
    everything = np.ones(white.size, bool)
    white_J, white_L = noise.whiten(J), noise.whiten(L)
    states = WindowStates(white_L, noise.row_window, everything)
    shared = fitted.covariance @ (fitted.columns.T @ states.off(white))
    local = states.solve(white - white_J @ shared, len(problem.windows), noise.row_window)
    return np.asarray(left - J @ shared - np.sum(L * local[problem.row_window], axis=1), float)
