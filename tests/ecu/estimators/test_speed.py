"""The doubt of the speed: how far it may be wrong because wheels slide."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ecu.estimators.motion.speed import DRIFT, LEANING, SLIDING, doubt_carried, doubt_of_wheels

DT = 0.01
GAIN = 5.0 * DT


def after(seconds, doubt, step):
    for _ in range(round(seconds / DT)):
        doubt = step(doubt)
    return doubt


def test_while_no_wheel_has_influence_the_errors_of_the_acceleration_add_up():
    assert after(2.0, 0.0, lambda d: doubt_carried(d, 0.0, 0.0, GAIN, DT)) == pytest.approx(2.0 * LEANING)


def test_while_all_wheels_roll_the_doubt_is_what_the_filter_leaves_of_the_drift():
    """A steady acceleration error over the filter's bandwidth of 5/s."""
    assert after(5.0, 3.0, lambda d: doubt_carried(d, 1.0, 0.0, GAIN, DT)) == pytest.approx(
        DRIFT / 5.0, rel=1e-6
    )


def test_a_change_that_no_wheel_proves_is_doubtful_in_full():
    assert doubt_carried(0.1, 0.0, -0.3, GAIN, DT) == pytest.approx(0.4 + LEANING * DT)


@given(st.floats(0.0, 5.0), st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(-0.5, 0.5))
def test_more_influence_never_leaves_more_doubt(before, some, more, unproven):
    low, high = sorted((some, more))
    assert doubt_carried(before, high, unproven, GAIN, DT) <= doubt_carried(before, low, unproven, GAIN, DT)


def test_wheels_that_lock_leave_what_grip_could_not_have_braked():
    """From 4 m/s to nothing in 0.1 s, of which grip explains 0.8 m/s; a second later the machine has slowed by what the least friction takes."""
    doubt = after(0.1, 0.0, lambda d: doubt_of_wheels(d, -0.4, 0.08, DT))
    assert doubt == pytest.approx(3.2 - 0.1 * SLIDING)
    assert after(1.0, doubt, lambda d: doubt_of_wheels(d, 0.0, 0.08, DT)) == pytest.approx(doubt - SLIDING)


def test_braking_within_grip_is_no_doubt():
    assert after(1.0, 0.0, lambda d: doubt_of_wheels(d, -0.07, 0.08, DT)) == 0.0
