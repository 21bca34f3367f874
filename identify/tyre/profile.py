"""Profile-likelihood intervals of a tyre's parameters: where one may lie when all other unknowns follow it, without linearisation."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from identify.ends import ProfileInterval, interval
from identify.tyre.estimate import Compressed, Estimate, Problem

Array = NDArray[np.float64]


def profiles(problem: Problem, found: Estimate, names: Sequence[str]) -> Mapping[str, ProfileInterval]:
    """By name; the noise stays that of the fit, and the data count as much less as the fit says that they scatter more."""
    cost = _Likelihood(problem, found)
    # about the optimum of the scattered data, which the fit's own is unless priors count
    best = cost.least(cost.start, None)
    return {name: _profile(cost, found, best, name) for name in names}


def with_profiles(problem: Problem, found: Estimate, names: Sequence[str]) -> Estimate:
    """The estimate with intervals of these parameters by the likelihood itself."""
    return replace(found, profiled={**found.profiled, **profiles(problem, found, names)})


class _Likelihood:
    """Twice the negative log-likelihood with priors, at its least over all unknowns or over all but one."""

    def __init__(self, problem: Problem, found: Estimate) -> None:
        self.unknowns = problem.unknowns
        self.start = np.array([found.values[u.name] for u in self.unknowns])
        self._compressed = Compressed(problem.held_at(found.values), self.unknowns, found.noise)
        self._priors = sum(1 for u in self.unknowns if u.prior_sd)
        self._scatter = found.scatter

    def least(self, x: Array, held: int | None) -> tuple[Array, float]:
        """The best unknowns and the cost there; held: number of the unknown that stays at its value in x."""
        free = np.array([i for i in range(x.size) if i != held], np.intp)
        low, high = (np.array([getattr(u, edge) for u in self.unknowns])[free] for edge in ("lower", "upper"))

        def full(part: Array) -> Array:
            out = x.copy()
            out[free] = part
            return out

        margin = 1e-9 * (high - low)

        def residual(part: Array) -> Array:
            return self._scaled(self._compressed.residual(full(part)))

        def jacobian(part: Array) -> Array:
            return self._scaled(self._compressed.jacobian(full(part))[:, free])

        found = least_squares(
            residual,
            np.clip(x[free], low + margin, high - margin),
            jacobian,
            bounds=(low, high),
            x_scale=[self.unknowns[i].typical for i in free.tolist()],
            xtol=1e-7,
            ftol=1e-9,
            gtol=1e-12,
            max_nfev=30,
        )
        return full(found.x), 2.0 * float(found.cost)

    def _scaled(self, rows: Array) -> Array:
        # the priors' rows come first
        out = rows.copy()
        out[self._priors :] /= np.sqrt(self._scatter)
        return out


def _profile(cost: _Likelihood, found: Estimate, best: tuple[Array, float], name: str) -> ProfileInterval:
    """best: all unknowns at the optimum, and the cost there."""
    at, least = best
    own = [u.name for u in cost.unknowns].index(name)
    covariance = found.covariance
    # (nothing follows a parameter of which only the bounds are known)
    follow = (
        np.zeros(at.size) if name in found.free else covariance[:, own] / max(covariance[own, own], 1e-300)
    )

    def fall(value: float) -> float:
        moved = at + follow * (value - at[own])
        moved[own] = value
        _, there = cost.least(moved, own)
        return float(max(there - least, 0.0) ** 0.5)

    u = cost.unknowns[own]
    bounds = (u.lower, u.upper)
    if name in found.free:
        # no linearised width: begin at a change that matters
        return interval(fall, float(at[own]), u.typical, bounds, furthest=math.inf)
    return interval(fall, float(at[own]), found.interval(name).sd, bounds)
