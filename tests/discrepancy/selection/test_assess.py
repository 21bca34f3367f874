"""Where a search begins its next round."""

import pytest

from discrepancy.estimation.fit import fit
from discrepancy.estimation.noise import white_noise
from discrepancy.estimation.problem import Problem
from discrepancy.selection.assess import from_prior
from tests.discrepancy.decision.test_detectability import recorded, swinging

TRUE, OTHER = 0.0, 0.23  # of the spring; at the other one swing more, and the fit is caught


@pytest.mark.parametrize(("fitted_at", "home_at"), [(TRUE, OTHER), (OTHER, TRUE)])
def test_a_fit_returns_to_priors_only_where_that_is_better(fitted_at: float, home_at: float) -> None:
    problem = Problem(swinging(0.0), [recorded()])
    start = problem.start()
    noise = white_noise(problem, problem.measured - problem.predict(start))
    fitted, home = (fit(problem, noise, ("spring",), start.having(spring=at)) for at in (fitted_at, home_at))
    assert abs(fitted.values.shared["spring"] - home.values.shared["spring"]) > 0.02
    found = from_prior(problem, noise, fitted, home.values)
    assert found.values.shared["spring"] == pytest.approx(TRUE, abs=1e-3)
