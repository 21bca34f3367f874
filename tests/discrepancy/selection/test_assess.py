"""Where a search begins its next round."""

from collections.abc import Mapping

import numpy as np
import pytest

from discrepancy.estimation.fit import Fit, fit
from discrepancy.estimation.noise import Noise, white_noise
from discrepancy.estimation.problem import Problem
from discrepancy.model.description import Effect, Model, Parameter, Window
from discrepancy.selection.assess import assess, from_prior, from_typical_shapes
from discrepancy.selection.state import Settings
from discrepancy.signals.recording import Array, Recording, signal
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


WAVES = 1.0  # wavelength of a rough road
ELSEWHERE = 0.85  # there a fit matches it over a part of the way only


def rough(window: Window, values: Mapping[str, float], _: Mapping[str, Array]) -> dict[str, Array]:
    """A road that rises and falls by the sine of the way."""
    return {"height": values["high"] * np.sin(2.0 * np.pi * window.time_s / values["wavelength"])}


def fitted_to_rough_ground(begun_at: float, scored_at: float) -> tuple[Problem, Noise, Fit]:
    """The problem of a recording of waves, and a fit of height and wavelength; both wavelengths are starts."""
    high = Parameter(name="high", unit="m", lower=0.0, upper=1.0, typical=0.1)
    shape = Parameter(
        name="wavelength", unit="m", value=scored_at - 0.02, lower=0.2, upper=5.0, typical=0.02, shape=True
    )
    waves = Effect(name="waves", sentence="", equation="", parameters=(high, shape), kind="physics", place="")
    model = Model(name="road", sentence="", inputs={}, outputs={"height": "m"}, nuisances=(), effects=(waves,),
                  simulate=rough, step_s=0.02, window_s=10.0)  # fmt: skip
    way = 0.02 * np.arange(500)
    seen = 0.2 * np.sin(2.0 * np.pi * way / WAVES) + np.random.default_rng(3).normal(0.0, 0.02, way.size)
    problem = Problem(model, [Recording("road", {"height": signal(way, seen, "m")})])
    noise = white_noise(problem, np.random.default_rng(4).normal(0.0, 0.02, problem.measured.size))
    start = problem.start().having(high=0.1, wavelength=begun_at)
    return problem, noise, fit(problem, noise, ("high", "wavelength"), start)


@pytest.mark.parametrize("begun_at", [ELSEWHERE, WAVES])
def test_a_shape_returns_to_where_it_was_scored_if_that_leads_to_a_better_minimum(begun_at: float) -> None:
    problem, noise, fitted = fitted_to_rough_ground(begun_at, scored_at=0.99 * WAVES)
    assert (abs(fitted.values.shared["wavelength"] - WAVES) > 0.05) == (begun_at == ELSEWHERE)
    found = from_typical_shapes(problem, noise, fitted, ["waves"])
    assert found.values.shared["wavelength"] == pytest.approx(WAVES, abs=2e-3)
    assert found.values.shared["high"] == pytest.approx(0.2, abs=0.01)
    assert found.sse <= fitted.sse


def test_a_shape_stays_where_the_fit_from_its_typical_value_is_the_worse_one() -> None:
    problem, noise, fitted = fitted_to_rough_ground(WAVES, scored_at=ELSEWHERE)
    assert from_typical_shapes(problem, noise, fitted, ["waves"]) is fitted


SEEN = 0.02  # noise of the height [m]


def overturning(window: Window, values: Mapping[str, float], _: Mapping[str, Array]) -> dict[str, Array]:
    """Leans on what it drove into, or overturns without that: in another way at each mass, as a chaotic motion does."""
    leaning = values["held"] * (1.0 - np.exp(-window.time_s))
    over = 3.0 * values["mass"] + 2.0 * np.sin(2.0 * np.floor(values["mass"] / 0.05) + 2.0 * window.time_s)
    return {"height": leaning if values["held"] > 0.3 else over}


@pytest.mark.parametrize("seed", range(3))
def test_what_is_missing_is_no_noise_where_the_baseline_overturns(seed: int) -> None:
    """The columns of an expensive model are those of the baseline, and the fit has moved: at its point they explain nothing."""
    mass = Parameter(name="mass", unit="kg", lower=-5.0, upper=5.0, typical=0.1, prior_sd=1.0)
    held = Parameter(name="held", unit="m", lower=0.0, upper=10.0, typical=1.0)
    pile = Effect(name="pile", sentence="", equation="", parameters=(held,), kind="physics", place="")
    model = Model(name="machine", sentence="", inputs={}, outputs={"height": "m"}, nuisances=(mass,), effects=(pile,),
                  simulate=overturning, step_s=0.02, window_s=10.0, jacobian_reach=6.0)  # fmt: skip
    time_s = 0.02 * np.arange(500)
    seen = 1.1 * (1.0 - np.exp(-time_s)) + np.random.default_rng(seed).normal(0.0, SEEN, time_s.size)
    problem = Problem(model, [Recording("into a pile", {"height": signal(time_s, seen, "m")})])
    state = assess(problem, (), problem.start(), Settings())
    assert state.fit.values.shared["mass"] != 0.0
    # under a noise that has not swallowed it, it is seen
    assert state.fit.sse > 100.0 * problem.measured.size
