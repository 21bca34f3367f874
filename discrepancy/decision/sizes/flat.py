"""Intervals of parameters whose small changes do nothing: a stop that is never touched, an angle beyond which nothing changes.

The linearised interval would have no width there. The interval is then found by the likelihood itself, the other parameters held.
"""

from typing import Final

import numpy as np
from scipy.stats import chi2

from discrepancy.estimation.fit import Fit
from discrepancy.estimation.noise import Noise
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Parameter
from discrepancy.selection.screen import Projector

RISE: Final = float(chi2.ppf(0.95, 1))  # of the SSE at the ends of a 95 % interval
HALVINGS: Final = 8  # of the way to a bound, to find an end: to 0.4 % of it


def is_flat(parameter: Parameter, fitted: Fit) -> bool:
    """Whether the rows do not depend on a fitted parameter at its value."""
    return parameter.name in fitted.names and fitted.sd(parameter.name) == 0.0


def interval(problem: Problem, noise: Noise, fitted: Fit, parameter: Parameter) -> tuple[float, float]:
    """The values [unit of the parameter] between its bounds at which the SSE is less than RISE above that of the fit."""
    states = Projector(problem, noise, fitted).states
    value = fitted.values.shared[parameter.name]

    def sse(at: float) -> float:
        point = fitted.values.with_shared({parameter.name: at})
        left = states.off(noise.whiten((problem.measured - problem.predict(point))[:, None]))
        return float(np.sum(left**2))

    most = sse(value) + RISE

    def end(bound: float) -> float:
        if not np.isfinite(bound) or sse(bound) < most:
            return bound
        inside, outside = value, bound
        for _ in range(HALVINGS):
            middle = 0.5 * (inside + outside)
            inside, outside = (middle, outside) if sse(middle) < most else (inside, middle)
        return outside

    return end(parameter.lower), end(parameter.upper)
