"""Inverses of normal matrices do not depend on the units of the parameters."""

import numpy as np
import pytest

from discrepancy.estimation.normal_equations import inverse

UNITS = np.array([1e-8, 1.0, 1e6])  # a pressure in Pa, an angle, a small length in m


def _normal(seed: int = 5) -> np.ndarray:
    J = np.random.default_rng(seed).normal(size=(40, 3))
    return J.T @ J


def test_units_change_nothing_but_the_units() -> None:
    plain = np.linalg.inv(_normal())
    scaled = inverse(_normal() * np.outer(UNITS, UNITS))
    assert scaled * np.outer(UNITS, UNITS) == pytest.approx(plain, rel=1e-9)


def test_parameters_that_say_the_same_share_it() -> None:
    one = _normal()[:, [0, 1, 1]][[0, 1, 1]]
    found = inverse(one * np.outer(UNITS, UNITS))
    assert np.isfinite(found).all()
    together = np.array([0.0, 1.0 / UNITS[1], 1.0 / UNITS[2]])  # both moved, each by half of it
    assert (UNITS * (found @ (one * np.outer(UNITS, UNITS) @ together)))[1:] == pytest.approx([1.0, 1.0])


def test_a_direction_without_information_keeps_its_value() -> None:
    normal = _normal()
    normal[2] = normal[:, 2] = 0.0
    assert not inverse(normal)[2].any()


def test_rounding_error_counts_as_no_information() -> None:
    whole = _normal() * np.outer(UNITS, UNITS)
    left = whole.copy()
    left[2] = left[:, 2] = 0.0
    left[2, 2] = 1e-15 * whole[2, 2]
    assert not inverse(left, whole)[2].any()
    assert inverse(left, whole)[0, 0] > 0.0
