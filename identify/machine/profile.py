"""Profile-likelihood intervals: where a parameter may lie when all others follow it, without linearisation.

The value of a parameter is held and the others are fitted again. The interval ends where twice the log-likelihood has fallen by the 95 %
quantile of chi-square (Venzon and Moolgavkar 1988). The noise stays that of the best fit. Blocks of time do not widen the interval, and
noise of the inputs is not corrected for: it is compared with the linearised interval of the same likelihood.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

from discrepancy.estimation.effort import Effort
from discrepancy.estimation.fit import fit
from discrepancy.estimation.problem import Problem, Values
from identify.machine.coordinates import Coordinates
from identify.machine.drives import NORMAL_95, Identified

STEPS: Final = 6  # evaluations of the profile on each side
CLOSE: Final = 0.02  # of the root of the fall, at which an end is found
FURTHEST: Final = 3.0  # times the linear half width, beyond which no end is looked for
EFFORT: Final = Effort(
    iterations=3
)  # the start follows the linear fit, so that few steps remain for its curvature


@dataclass(frozen=True, slots=True, kw_only=True)
class ProfileInterval:
    """95 % by the profile likelihood beside the linearised interval of the same noise; in the parameter's unit of the model."""

    lower: float
    upper: float
    linear: tuple[float, float]

    @property
    def asymmetry(self) -> float:
        """Largest difference of an end from the linear one, over the linear half width."""
        half = 0.5 * (self.linear[1] - self.linear[0])
        return max(abs(self.lower - self.linear[0]), abs(self.upper - self.linear[1])) / half


def profiles(found: Identified, names: tuple[str, ...]) -> Mapping[str, ProfileInterval]:
    """By parameter of the model. Costs some dozens of simulations each."""
    return {name: profile(found, name) for name in names}


def profile(found: Identified, name: str) -> ProfileInterval:
    """The interval of one parameter of the model."""
    joint = found.coordinates.prior
    if joint is None or name not in joint.names:
        (fitted_name,) = found.coordinates.fitted([name])
        return _profile(found, found.problem, found.fit.values, name, fitted_name)
    # in coordinates that begin with it, the parameter is the first of them alone
    coordinates = Coordinates(joint.beginning_with(name))
    problem = Problem(coordinates.model(found.model), found.problem.recordings)
    return _profile(found, problem, _in(coordinates, found, problem), name, coordinates.fitted([name])[0])


def _in(coordinates: Coordinates, found: Identified, problem: Problem) -> Values:
    """The fitted values in other coordinates."""
    values = problem.start().with_shared(coordinates.to_fitted(found.values))
    warm_up = coordinates.to_fitted(found.coordinates.of_model(found.fit.values.warm_up))
    return replace(values, warm_up=warm_up)


def _profile(
    found: Identified, problem: Problem, values: Values, name: str, fitted_name: str
) -> ProfileInterval:
    p = problem.model.parameter(fitted_name)
    names = problem.nuisance_names
    best = fit(problem, found.noise, names, values, effort=EFFORT)
    at, sd, own = best.values.shared[fitted_name], best.sd(fitted_name), names.index(fitted_name)
    others = tuple(n for n in names if n != fitted_name)
    follow = best.covariance[:, own] / best.covariance[own, own]

    def fall(value: float) -> float:
        """Root of twice the log-likelihood lost with the parameter held there."""
        moved = {
            n: min(max(best.values.shared[n] + k * (value - at), q.lower), q.upper)
            for n, k in zip(names, follow.tolist(), strict=True)
            for q in [problem.model.parameter(n)]
        }
        held = best.values.with_shared({**moved, fitted_name: value})
        lost = fit(problem, found.noise, others, held, effort=EFFORT).sse - best.sse
        prior = ((value - p.value) / p.prior_sd) ** 2 if p.prior_sd else 0.0
        return float(max(lost + prior, 0.0) ** 0.5)

    def end(side: float) -> float:
        limit = p.upper if side > 0.0 else p.lower
        inside, outside = 0.0, FURTHEST * NORMAL_95
        step = NORMAL_95
        for _ in range(STEPS):
            value = at + side * step * sd
            if (value - limit) * side >= 0.0:
                return limit
            there = fall(value)
            if abs(there - NORMAL_95) < CLOSE:
                break
            inside, outside = (step, outside) if there < NORMAL_95 else (inside, step)
            # the root of the fall is nearly proportional to the distance; bracketed, because it need not be
            step = min(
                max(step * NORMAL_95 / max(there, 0.1), 0.9 * inside + 0.1 * outside),
                0.1 * inside + 0.9 * outside,
            )
        return float(min(max(at + side * step * sd, p.lower), p.upper))

    low, high = end(-1.0), end(1.0)
    half = NORMAL_95 * sd
    return _of_model(found, name, fitted_name, low, high, (at - half, at + half))


def _of_model(
    found: Identified, name: str, fitted_name: str, low: float, high: float, linear: tuple[float, float]
) -> ProfileInterval:
    """The interval in the parameter's own unit."""
    if name == fitted_name:
        return ProfileInterval(lower=low, upper=high, linear=linear)
    mean, sd = found.priors[name]
    return ProfileInterval(
        lower=mean + sd * low, upper=mean + sd * high, linear=(mean + sd * linear[0], mean + sd * linear[1])
    )
