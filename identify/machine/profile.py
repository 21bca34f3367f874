"""Profile-likelihood intervals: where a parameter may lie when all others follow it, without linearisation.

The value of a parameter is held and the others are fitted again. The noise stays that of the best fit. Blocks of time do not widen the interval, and
noise of the inputs is not corrected for: it is compared with the linearised interval of the same likelihood.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from discrepancy.estimation.effort import Effort
from discrepancy.estimation.fit import fit
from discrepancy.estimation.problem import Problem, Values
from identify.ends import ProfileInterval, interval
from identify.machine.coordinates import Coordinates
from identify.machine.drives import Identified

EFFORT: Final = Effort(iterations=3)
"""The start follows the linear fit, so that few steps remain for its curvature."""


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

    return _of_model(found, name, fitted_name, interval(fall, at, sd, (p.lower, p.upper)))


def _of_model(found: Identified, name: str, fitted_name: str, of_fit: ProfileInterval) -> ProfileInterval:
    """The interval in the parameter's own unit."""
    if name == fitted_name:
        return of_fit
    mean, sd = found.priors[name]
    lower, upper = of_fit.linear
    return ProfileInterval(
        lower=mean + sd * of_fit.lower,
        upper=mean + sd * of_fit.upper,
        linear=(mean + sd * lower, mean + sd * upper),
    )
