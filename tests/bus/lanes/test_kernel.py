"""A kernel does in every lane what Python does with that lane's numbers."""

import math
from functools import cache
from typing import NamedTuple

import numba
import numpy as np
import pytest

from bus.lanes.kernel import Fixed, Joined, Lanes, Same, kernel, values_of
from bus.lanes.operations import LANES
from bus.lanes.reader import NotForLanesError

RNG = np.random.default_rng(7)
SIZE = 6


@cache
def compiled(function, arguments, rare=()):
    """A function of the arrays that calls the kernel."""
    made = kernel(f"k_{function.__name__}", function, arguments, rare)

    @numba.njit(error_model="numpy")
    def call(arrays):
        return made(arrays)

    return call


def run(function, arguments, arrays, rare=()):
    """What the kernel returns after it has worked on the arrays."""
    return compiled(function, arguments, rare)(arrays)


def check(function):
    """The kernel of function(a, out) against the function itself, for many numbers, to rounding."""
    for _ in range(50):
        a, out = RNG.standard_normal((SIZE, LANES)) * 2.0, RNG.standard_normal((SIZE, LANES))
        a[RNG.random(a.shape) < 0.1] = 0.0
        expected = out.copy()
        for lane in range(LANES):
            column = expected[:, lane].copy()
            function(a[:, lane], column)
            expected[:, lane] = column
        assert run(function, (Lanes(SIZE), Lanes(SIZE, written=True)), (a, out)) == 0
        np.testing.assert_allclose(out, expected, rtol=1e-13, atol=1e-14)


def products(a, out):
    out[0] = a[0] * a[1] + a[2] / (1.0 + a[3] ** 2) - 3 * a[4]
    out[1] += -(a[0] ** 2)
    out[2] = min(a[0], a[1], 0.5) - max(a[2], -0.25)
    out[3] = abs(a[5]) * math.copysign(2.0, a[4]) + math.sqrt(a[0] * a[0])
    out[4] = math.floor(a[0]) + float(a[1])
    total = 0.0
    for i in range(SIZE):
        for j in range(i):
            total += a[i] * a[j]
    out[5] = total


def test_arithmetic_is_that_of_python():
    check(products)


def library(a, out):
    out[0] = math.sin(a[0]) * math.cos(a[1])
    out[1] = math.atan(a[2]) + math.exp(a[3])
    out[2] = math.atan2(a[0], a[1]) + math.tanh(a[2])
    out[3] = math.asin(max(min(a[3], 1.0), -1.0)) + math.tan(a[4])
    out[4] = abs(a[5]) ** 1.7


def test_functions_are_those_of_the_library_to_rounding():
    check(library)


def early(x, y):
    """Returns in four places."""
    if x > 1.0:
        return y, 1.0
    if y > 0.0:
        if x < -1.0:
            return x * y, 2.0
        y += 10.0
    elif x > 0.0:
        return -x, 3.0
    return x + y, 4.0


def branches(a, out):
    if a[0] > 0.0 and (a[1] < 0.0 or not a[2] > 0.5):
        out[0] = a[1]
        if a[3] > 0.0:
            out[1] = a[3] if a[4] > 0.0 else 7.0
    elif a[0] == 0.0:
        out[0] = 5.0
    else:
        out[2] = -a[0]
    out[3], out[4] = early(a[0], a[1])
    both = a[0] > 0.0
    out[5] = 1.0 if both == (a[1] > 0.0) else 2.0


def counted(out, at, value):
    """A function that leaves a trace."""
    out[at] += 1.0
    return value


def asked(a, out):
    value = counted(out, 0, 2.0) if a[0] > 0.0 else counted(out, 1, 3.0)
    if a[1] > 0.0 and counted(out, 2, a[2]) > 0.0:
        value += 10.0
    if a[1] > 0.0 or counted(out, 3, a[3]) > 0.0:
        value += 100.0
    out[4] = value


def test_what_is_not_evaluated_leaves_no_trace():
    check(asked)


def test_each_lane_takes_its_own_branches():
    check(branches)


def chained(a, out):
    inside = -0.5 <= a[0] < 0.5
    for i in range(SIZE):
        if inside:
            value = a[i] if a[i] > 0.0 else 0.0
            out[i] += value


def test_names_within_branches():
    check(chained)


def rarely(a, out):
    out[0] = 100.0


def with_rare(a, out):
    out[0] = a[0]
    if a[1] > 0.0:
        rarely(a, out)
    out[1] = a[1]


def test_a_lane_that_comes_to_a_rare_part_is_reported_and_unchanged():
    a, out = RNG.standard_normal((SIZE, LANES)), RNG.standard_normal((SIZE, LANES))
    a[1] = [-1.0, 1.0, -1.0, 1.0]
    before = out.copy()
    found = run(with_rare, (Lanes(SIZE), Lanes(SIZE, written=True)), (a, out), rare=(rarely,))
    assert found == 0b1010
    np.testing.assert_array_equal(out[:, 1::2], before[:, 1::2])
    np.testing.assert_array_equal(out[:2, 0::2], a[:2, 0::2])


class Work(NamedTuple):
    scratch: np.ndarray


def switched(active, out, work):
    """Jumps within jumps, in a loop, over a work array."""
    for i in range(3):
        if active[0] != 0.0:
            work.scratch[i] = out[i] * active[4]
            more = 1.0
            if active[1] > active[2]:
                work.scratch[i] += active[5] if out[i] > 0.0 else more
        elif active[1] > 0.5:
            more = 2.0
            work.scratch[i] = more
    for i in range(3):
        out[i + 3] = work.scratch[i]


@pytest.mark.parametrize("seed", range(16))
def test_jumps_are_joined(seed):
    rng = np.random.default_rng(seed)
    same, lanes = rng.random(4).round(), rng.standard_normal((2, LANES))
    out = rng.standard_normal((SIZE, LANES))
    expected = out.copy()
    for lane in range(LANES):
        column = expected[:, lane].copy()
        switched(np.concatenate([same, lanes[:, lane]]), column, Work(np.zeros(3)))
        expected[:, lane] = column
    work = Fixed(lambda: Work(values_of(np.zeros(3))), lambda made: [made.scratch])
    run(switched, (Joined(4, 2), Lanes(SIZE, written=True), work), (same, lanes, out))
    np.testing.assert_allclose(out, expected, rtol=1e-14, atol=1e-15)


def settled(settings, out):
    out[0] = settings[0] * out[1] + settings[1]


def test_numbers_that_are_the_same_in_all_lanes():
    settings, out = np.array([2.0, 0.25]), RNG.standard_normal((SIZE, LANES))
    expected = 2.0 * out[1] + 0.25
    run(settled, (Same(2), Lanes(SIZE, written=True)), (settings, out))
    np.testing.assert_allclose(out[0], expected, rtol=1e-15)


def seeks(a, out):
    i = 0
    while a[i] > 0.0:
        i += 1
    out[0] = a[i]


def picks(a, out):
    out[0] = a[int(a[1])]


def returns_in_jump(a, out):
    if a[0] > 0.0:
        return
    out[0] = 1.0


@pytest.mark.parametrize(
    ("function", "kind", "part"),
    [
        (seeks, Lanes(SIZE), "a statement While"),
        (picks, Lanes(SIZE), "int has no text to read"),
        (returns_in_jump, Same(SIZE), "a return within a condition that is the same in all lanes"),
    ],
)
def test_what_cannot_be_done_is_refused_with_its_place(function, kind, part):
    a = np.zeros((SIZE, LANES)) if isinstance(kind, Lanes) else np.zeros(SIZE)
    with pytest.raises(NotForLanesError, match=rf"test_kernel\.py:\d+: {part}"):
        run(function, (kind, Lanes(SIZE, written=True)), (a, np.zeros((SIZE, LANES))))
