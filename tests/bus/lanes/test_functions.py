"""Functions for vectors are as exact as those of the C library."""

import math

import numba
import numpy as np
import pytest

from bus.lanes import functions
from bus.lanes.kernel import Lanes, kernel
from bus.lanes.operations import LANES

RNG = np.random.default_rng(2026)


def ulps(found, exact):
    """Largest error in units in the last place of the exact values, which have more digits."""
    nearest = np.abs(exact).astype(np.float64)
    return float(np.max(np.abs(np.asarray(found, np.longdouble) - exact) / np.spacing(nearest)))


@pytest.mark.parametrize("name", ["sin", "cos"])
@pytest.mark.parametrize("largest", [0.8, 7.0, 1e3, functions.LARGEST_ANGLE])
def test_sine_and_cosine(name, largest):
    x = RNG.uniform(-largest, largest, 20_000)
    exact = getattr(np, name)(x.astype(np.longdouble))
    assert ulps([getattr(functions, name)(v) for v in x], exact) < 2.0


def test_arctangent():
    x = np.concatenate(
        [RNG.uniform(-4, 4, 20_000), RNG.standard_normal(20_000) * 10.0 ** RNG.uniform(-12, 12, 20_000)]
    )
    exact = np.arctan(x.astype(np.longdouble))
    assert ulps([functions.atan(v) for v in x], exact) < 2.0


def test_exponential_function():
    x = RNG.uniform(-700, 700, 20_000)
    exact = np.exp(x.astype(np.longdouble))
    assert ulps([functions.exp(v) for v in x], exact) < 2.0


def test_exact_where_the_result_is():
    assert functions.sin(0.0) == 0.0
    assert functions.cos(0.0) == 1.0
    assert functions.exp(0.0) == 1.0
    assert functions.atan(0.0) == 0.0
    assert functions.atan(1e300) == math.pi / 2


@pytest.mark.parametrize("name", ["sin", "cos", "atan", "exp"])
def test_symmetry(name):
    f = getattr(functions, name)
    for x in RNG.uniform(-20, 20, 1000).tolist():
        mirrored = {"sin": -f(-x), "cos": f(-x), "atan": -f(-x), "exp": f(x)}[name]
        assert f(x) == mirrored


def of_vectors(a, out):
    """What a kernel makes of the four."""
    out[0] = math.sin(a[0])
    out[1] = math.cos(a[1])
    out[2] = math.atan(a[2])
    out[3] = math.exp(a[3])


def test_the_same_in_a_kernel():
    """There a product and a sum are one instruction."""
    made = kernel("of_vectors", of_vectors, (Lanes(4), Lanes(4, written=True)))

    @numba.njit
    def run(a, out):
        return made((a, out))

    given, found = RNG.uniform(-6, 6, (2000, 4, LANES)), np.zeros((2000, 4, LANES))
    for a, out in zip(given, found, strict=True):
        run(a, out)
    for i, f in enumerate((np.sin, np.cos, np.arctan, np.exp)):
        assert ulps(found[:, i], f(given[:, i].astype(np.longdouble))) < 2.0
