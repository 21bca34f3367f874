"""Checks the trust region by a global search (differential evolution): if they find different tyres, the result may be a local minimum.

Population 100, at most 100 generations, bounds of the thesis (125). Both optimise the same cost: nominal load and pressure, zeros and scale factors
of the runs solved for at every point, since the force is linear in them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, differential_evolution

from discrepancy.estimation.autoregression import Whitener
from identify.rig.preparing import slower
from identify.tyre.estimate import Noise, estimate
from identify.tyre.rig_problem import RigProblem, Unknown

Array = NDArray[np.float64]

POPULATION, GENERATIONS = 100, 100
AGREED = 0.02  # of a parameter's typical change, by which both may differ
SLOWER = 5  # times fewer samples than in the fit, because the search evaluates the cost 10 000 times


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """The results of both optimisers."""

    names: tuple[str, ...]
    trust_region: Array  # its estimates, in the order of names
    evolution: Array
    costs: tuple[float, float]  # of both, trust region first
    evaluations: tuple[int, int]
    agree: bool


def searched(problem: RigProblem, seed: int = 0) -> Search:
    """Both optimisers on a nominal problem: unknown are its tyre's parameters and its law of relaxation."""
    slow = replace(
        problem, traces=[slower(t, SLOWER) for t in problem.traces], gain_sd=0.0, carcass_pressure=False
    )
    main = [u for u in slow.unknowns if not u.name.startswith(("tare ", "scale "))]
    cost = _Profiled(slow, main)
    low, high = np.array([u.lower for u in main]), np.array([u.upper for u in main])
    size = np.array([u.typical for u in main])
    noise = Noise(
        [Whitener(np.zeros((0, 1, 1)), np.array([[1.0 / max(t.force_sd, 1.0)]])) for t in slow.traces],
        [t.kept.astype(float) for t in slow.traces],
    )
    local = estimate(slow, noise=noise)
    near_x = np.array([local.values[u.name] for u in main])

    def total(x: Array) -> float:
        return float(np.sum(cost.residual(x) ** 2))

    found = differential_evolution(
        total,
        Bounds(low, high),
        popsize=max(1, POPULATION // len(main)),
        maxiter=GENERATIONS,
        tol=1e-8,
        rng=seed,
        polish=False,
    )
    near = np.abs(near_x - found.x) <= AGREED * size
    return Search(
        names=tuple(u.name for u in main),
        trust_region=near_x,
        evolution=found.x,
        costs=(float(np.sum(cost.residual(near_x) ** 2)), float(found.fun)),
        evaluations=(local.evaluations, int(found.nfev)),
        agree=bool(near.all()),
    )


class _Profiled:
    """Residuals of all runs with the best zero and scale factor of each, which enter linearly: the search has fewer dimensions so."""

    def __init__(self, problem: RigProblem, main: Sequence[Unknown]) -> None:
        self._problem, self._main = problem, [u.name for u in main]
        self._rest = {u.name: u for u in problem.unknowns if u.name not in self._main}
        self._sizes = [max(t.force_sd, 1.0) for t in problem.traces]

    def residual(self, x: Array) -> Array:
        """(runs,) roots of each run's cost, priors of its nuisances included."""
        values = dict(zip(self._main, np.asarray(x, float).tolist(), strict=True)) | {
            name: u.start for name, u in self._rest.items()
        }
        names, out = list(values), []
        for part, size in zip(self._problem.parts(values), self._sizes, strict=True):
            own = [i for i, c in enumerate(part.columns) if names[c] in self._rest]
            unknowns = [self._rest[names[part.columns[i]]] for i in own]
            J = (part.by[part.kept] @ part.to[:, own]) / size
            e = part.residual[part.kept] / size
            prior = np.diag([1.0 / (u.prior_sd or np.inf) for u in unknowns])
            left = np.array([(u.start - u.prior) / (u.prior_sd or np.inf) for u in unknowns])
            normal = J.T @ J + prior @ prior
            step = np.linalg.solve(normal, -(J.T @ e + prior @ left))
            out.append(
                np.sqrt(max(0.0, float(np.sum((e + J @ step) ** 2) + np.sum((left + prior @ step) ** 2))))
            )
        return np.array(out)
