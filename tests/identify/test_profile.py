"""Profile likelihood of a tyre's parameters: the linear interval where the model is linear, the likelihood's where it is not."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import least_squares, minimize_scalar

from discrepancy.estimation.autoregression import Whitener
from identify.ends import NORMAL_95, interval
from identify.tyre.advice import undetermined
from identify.tyre.estimate import Noise, estimate
from identify.tyre.profile import profiles, with_profiles
from identify.tyre.rig_problem import Part, Unknown

SIZE = 0.02
X = np.linspace(-0.3, 0.5, 60)


@dataclass(frozen=True)
class Curve:
    """(PKX1 + PKX2 x) exp(PKX3 x), the change of a tyre's stiffness with load; or a line, without PKX3."""

    y: np.ndarray
    names: tuple[str, ...] = ("PKX1", "PKX2", "PKX3")

    @property
    def unknowns(self):
        starts = (1.0, 0.1, -0.1)
        return [
            Unknown(name=n, start=s, lower=-20.0, upper=20.0, typical=0.1)
            for n, s in zip(self.names, starts, strict=False)
        ]

    def held_at(self, values):
        return self

    def parts(self, values):
        a, b, c = (values.get(n, 0.0) for n in ("PKX1", "PKX2", "PKX3"))
        grow = np.exp(c * X)
        J = np.stack([grow, X * grow, X * (a + b * X) * grow], axis=1)[:, : len(self.names)]
        n = len(self.names)
        return [Part((a + b * X) * grow - self.y, J, np.eye(n), np.arange(n), np.ones(X.size, bool))]


def fitted(y, names=("PKX1", "PKX2", "PKX3"), start=None):
    problem = Curve(y, names)
    white = Noise([Whitener(np.zeros((0, 1, 1)), np.array([[1.0 / SIZE]]))], [np.ones(X.size)])
    return problem, estimate(problem, start, noise=white)


def noisy(value, seed=1):
    return value + SIZE * np.random.default_rng(seed).standard_normal(X.size)


def least(y, c):
    """The sum of squares with the exponent held: the model is linear in the others."""
    rows = np.stack([np.exp(c * X), X * np.exp(c * X)], axis=1)
    rest = y - rows @ np.linalg.lstsq(rows, y, rcond=None)[0]
    return float(rest @ rest) / SIZE**2


@pytest.mark.parametrize("louder", [1.0, 3.0])
def test_a_line_has_its_linear_interval(louder):
    """Data that scatter more than their noise is said to widen both alike."""
    y = 1.2 + 0.4 * X
    problem, found = fitted(y + louder * (noisy(y) - y), ("PKX1", "PKX2"))
    assert found.free == frozenset()
    assert (found.scatter > 5.0) == (louder > 1.0)
    for p in profiles(problem, found, problem.names).values():
        assert p.asymmetry < 0.02


def test_ends_are_those_of_a_profile_made_by_brute_force():
    y = noisy(2.0 * np.exp(1.5 * X))
    problem, found = fitted(y)
    bottom = minimize_scalar(
        lambda c: least(y, c), bounds=(-9.0, 9.0), method="bounded", options={"xatol": 1e-6}
    )
    grid = np.linspace(-9.0, 9.0, 18001)
    inside = grid[[(least(y, c) - bottom.fun) / found.scatter < NORMAL_95**2 for c in grid]]
    got = profiles(problem, found, ["PKX3"])["PKX3"]
    assert (got.lower, got.upper) == pytest.approx((inside[0], inside[-1]), abs=0.02 * np.ptp(inside))


@pytest.mark.parametrize("seed", range(3))
def test_parameters_that_only_change_together_get_the_interval_of_the_likelihood(seed):
    """At PKX2 = 0, PKX2 and PKX3 change the curve alike: the data bound them by the second order alone."""
    truth = 1.5 * np.exp(-0.15 * X)
    _, exact = fitted(truth, start={"PKX1": 1.5, "PKX2": 0.0, "PKX3": -0.15})
    assert exact.free == {"PKX2", "PKX3"}
    assert exact.by("PKX3") == "bounds"
    assert exact.interval("PKX3").sd > 5.0  # of bounds at +-20; a pseudo-inverse says 0.03
    y = noisy(truth, seed)
    problem, found = fitted(y)
    sure = with_profiles(problem, found, ["PKX2", "PKX3"])
    assert sure.by("PKX3") == "likelihood"
    for name, true in (("PKX2", 0.0), ("PKX3", -0.15)):
        i = sure.interval(name)
        assert i.lower < true < i.upper
    i = sure.interval("PKX3")
    for end in (i.lower, i.upper):
        fall = (least(y, end) - found.sse) / found.scatter
        assert fall == pytest.approx(NORMAL_95**2, rel=0.1)


def test_advice_names_the_pair():
    problem, found = fitted(noisy(1.5 * np.exp(-0.15 * X)))
    opened = {
        o.name: o.reason for o in undetermined(with_profiles(problem, found, ["PKX2", "PKX3"]), problem)
    }
    assert "PKX3" in opened["PKX2"]


@pytest.mark.parametrize("power", [1.0, 2.0, 0.5])
def test_ends_of_any_power_and_of_bounds(power):
    """A fall by a power of the distance has its ends at a known place."""
    got = interval(lambda x: abs(x - 1.0) ** power, 1.0, 0.3, (0.2, 50.0), furthest=np.inf)
    assert got.upper == pytest.approx(1.0 + NORMAL_95 ** (1.0 / power), rel=0.05)
    assert got.lower == pytest.approx(0.2)


def test_a_likelihood_that_never_falls_ends_at_the_bound_or_at_the_furthest_place():
    assert interval(lambda x: 0.0, 0.0, 1.0, (-2.5, 9.0)).lower == -2.5
    assert interval(lambda x: 0.0, 0.0, 1.0, (-2.5, 9.0)).upper == pytest.approx(3.0 * NORMAL_95)


def test_the_profile_of_a_parameter_is_that_of_scipy():
    """The same likelihood through scipy's own fit with the parameter held."""
    y = noisy(2.0 * np.exp(0.8 * X) * (1.0 + 0.2 * X), 4)
    problem, found = fitted(y)
    got = profiles(problem, found, ["PKX1"])["PKX1"]

    def cost(a):
        rest = least_squares(lambda q: ((a + q[0] * X) * np.exp(q[1] * X) - y) / SIZE, [0.4, 0.8])
        return 2.0 * rest.cost

    for end in (got.lower, got.upper):
        assert (cost(end) - found.sse) / found.scatter == pytest.approx(NORMAL_95**2, rel=0.05)
