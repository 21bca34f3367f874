"""Intervals of estimates widen where blocks of time disagree."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t as student

from discrepancy.decision.summary import estimate
from discrepancy.estimation.fit import fit
from discrepancy.estimation.noise import white_noise
from discrepancy.estimation.problem import Problem
from discrepancy.selection.candidate_fits import project_out
from discrepancy.selection.screen import time_blocks_of
from discrepancy.selection.search import search
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import Estimate
from tests.discrepancy.toys import record, tank

STRICT = Settings()


def width(found: Estimate) -> float:
    assert found.low is not None
    assert found.high is not None
    return found.high - found.low


def test_intervals_widen_where_scores_are_correlated_over_time() -> None:
    problem = Problem(tank(), [record(50, leak=0.05)])
    state, _ = search(problem, STRICT)
    leak = problem.model.parameter("leak")
    plain, found = estimate(leak, state.fit), estimate(leak, state.fit, state.noise)
    direction = project_out(state.fit, [state.fit.names.index("leak")])[:, 0]
    # errors that keep one sign against the sensitivity over each interval of time push the estimate about
    interval = np.where(time_blocks_of(state.noise) % 2 == 0, 1.0, -1.0)
    pushed = replace(state.fit, residual=2.0 * interval * np.sign(direction))
    wide = estimate(leak, pushed, state.noise)
    assert width(found) == pytest.approx(width(plain), rel=0.5)
    assert width(wide) > 4.0 * width(plain)


def test_the_jackknife_is_that_of_refitting_without_each_window() -> None:
    """Leak 0.03 in one half and 0.07 in the other: the interval must know that the windows disagree."""
    halves = [record(3, leak=leak, duration_s=120.0) for leak in (0.03, 0.07)]
    problem = Problem(tank("leak"), [replace(r, name=f"half {i}") for i, r in enumerate(halves)])
    start = problem.start().having(leak=0.05)
    noise = white_noise(problem, problem.measured - problem.predict(start))
    fitted = fit(problem, noise, ("area", "leak"), start)
    refitted = [
        fit(problem, noise, ("area", "leak"), start, rows=noise.row_window != w).values.shared["leak"]
        for w in range(len(problem.windows))
    ]
    n = len(refitted)
    reach = student.ppf(0.975, n - 1) * np.sqrt((n - 1) * np.var(refitted))
    leak = problem.model.parameter("leak")
    found = estimate(leak, fitted, noise)
    assert width(found) == pytest.approx(2.0 * reach, rel=0.15)
    assert width(found) > 1.5 * width(estimate(leak, fitted))


@pytest.mark.parametrize(("sds", "at"), [(0.05, "upper"), (0.5, None)])
def test_a_fit_that_ends_within_its_scatter_of_a_bound_stops_there(sds: float, at: str | None) -> None:
    """A bound at so many standard deviations above the fitted size: the last digits of a fit do not decide."""
    problem = Problem(tank("leak"), [record(50, leak=0.05)])
    state, _ = search(problem, STRICT)
    leak = problem.model.parameter("leak")

    def stops(share: float) -> str | None:
        """With this share of the information."""
        fitted = replace(state.fit, information=share * state.fit.information)
        bound = fitted.values.shared["leak"] + sds * fitted.sd("leak")
        return estimate(replace(leak, upper=bound), fitted).at_bound

    # a standard deviation of a tenth of a typical change, so that the thousandth of one that counts in any case is nearer
    known = (10.0 * state.fit.sd("leak") / leak.typical) ** 2
    assert stops(known) == at
    # with hardly any information every bound is within the scatter, and the fit stops at none
    assert stops(1e-9) is None
