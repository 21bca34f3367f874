"""The bracketed search: always on the safe side, as close as promised, and quick where the margin is smooth."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ecu.estimators.stability.search import goes_on, narrowed, next_trial, over

unhurried = settings(deadline=None)  # the first example compiles
FINE, COARSE = 1.0 / 512.0, 1.0 / 64.0


def searched(margin, trials, coarse, fine=FINE):
    """The search between 0 and 1, and how many margins it looked at."""
    search, looked = over(1.0, margin(0.0), margin(1.0)), 0
    for k in range(trials):
        if goes_on(search, fine):
            trial = next_trial(search, trials - 1 - k, fine, coarse)
            assert search.low < trial < search.high
            search, looked = narrowed(search, trial, margin(trial)), looked + 1
    return search, looked


SHAPES = {
    "line": lambda x: x,
    "square": lambda x: x * x,
    "root": math.sqrt,
    "plateau": lambda x: max(x - 0.4, 0.0) / 0.6,  # the present margin is the least until the rate matters
    "cliff": lambda x: math.tanh(40.0 * (x - 0.5)),
    "steep end": lambda x: x**9,
}


@pytest.mark.parametrize("name", SHAPES)
@unhurried
@given(root=st.floats(0.02, 0.98))
def test_the_limit_keeps_its_margin_and_is_as_close_as_promised(name, root):
    shape = SHAPES[name]
    level = shape(root) + (1e-9 if name == "plateau" else 0.0)
    if not shape(0.0) < level < shape(1.0):
        return
    search, _ = searched(lambda x: level - shape(x), 8, COARSE)
    assert shape(search.low) <= level < shape(search.high)
    # half a resolution is left of a bracket that is finer than promised
    assert search.high - search.low <= COARSE + 1e-12 or not goes_on(search, FINE)


@pytest.mark.parametrize("bend", [-0.45, -0.1, 0.0, 0.3])
def test_a_smooth_margin_needs_fewer_looks_than_halving(bend):
    """Nine halvings find every root to 1/512."""

    def shape(x):
        return x + bend * x * (1.0 - x)

    looks = []
    for k in range(2, 49):
        level = shape(k / 50.0)
        search, looked = searched(lambda x, level=level: level - shape(x), 10, FINE)
        assert k / 50.0 - FINE <= search.low <= k / 50.0
        looks.append(looked)
    assert sum(looks) / len(looks) < 7.0


def test_with_no_trial_to_spare_it_halves():
    search, looked = searched(lambda x: 0.1 - x**9, 6, COARSE)
    assert looked == 6
    assert search.high - search.low == pytest.approx(COARSE)
