"""Keeps Jacobian columns of expensive models and returns them at points near the one where they were computed.

A column costs one simulation, some seconds with the loader. Parameters move little between the fits of a search, and a slightly wrong
column only costs an additional step: the residual is always computed exactly.
"""

from collections import deque
from collections.abc import Mapping, Sequence

import numpy as np

from discrepancy.model.description import Parameter
from discrepancy.signals.recording import Array

# A column changes most with its own parameter, so that one may move only half as far as the others.
OWN_SHARE = 0.5  # of the reach
# Derivatives decide where a fit ends; columns of trial steps decide only what is tried. So derivatives are renewed sooner.
FITTED_SHARE = 0.2  # of the reach
PLACES = 2  # points at which columns of trial steps are kept: a fit with a prior conflict, and its priors
FITTED_PLACES = 6  # points at which derivatives are kept: each candidate fit moves away, and the next starts from the state again

Key = tuple[str, float | None]
"""A parameter, and the value of its trial step; None for a derivative."""


class JacobianCache:
    """Columns by parameter and trial step. reach: typical changes by which parameters may move before a column is computed again; 0 keeps none."""

    def __init__(self, parameters: Sequence[Parameter], reach: float) -> None:
        self._names = [p.name for p in parameters]
        self._typical = np.array([p.typical for p in parameters])
        self._reach = reach
        self._kept: dict[Key, deque[tuple[Array, Array]]] = {}

    def column(
        self, name: str, trial_step: float | None, shared: Mapping[str, float], *, anywhere: bool = False
    ) -> Array | None:
        """The raw column (N,) kept nearest to `shared`; None if it is too far away. anywhere: at any distance."""
        kept = self._kept.get((name, trial_step))
        if not kept:
            return None
        here = self._scaled(shared)
        moved, column = min(
            ((np.abs(here - at), column) for at, column in kept), key=lambda k: float(np.max(k[0]))
        )
        if anywhere:
            return column
        reach = self._reach * (FITTED_SHARE if trial_step is None else 1.0)
        if moved[self._names.index(name)] > OWN_SHARE * reach or np.max(moved) > reach:
            return None
        return column

    def keep(self, name: str, trial_step: float | None, shared: Mapping[str, float], column: Array) -> None:
        """Keep a column. Columns of cheap models, and of parameters of single windows, are not kept."""
        if self._reach > 0.0 and name in self._names:
            places = FITTED_PLACES if trial_step is None else PLACES
            kept = self._kept.setdefault((name, trial_step), deque(maxlen=places))
            kept.append((self._scaled(shared), column))

    def forget_derivatives(self) -> None:
        """Remove all derivatives, so that the next fit computes them at its own point."""
        self._kept = {key: kept for key, kept in self._kept.items() if key[1] is not None}

    def _scaled(self, shared: Mapping[str, float]) -> Array:
        """Shared parameters in typical changes."""
        return np.asarray(np.array([shared[name] for name in self._names]) / self._typical, float)
