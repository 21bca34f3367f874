"""Laws of profiles: what a script's points and sines mean at any time."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plant.unit.profile import Profile, Sine
from tests.plant.unit.profiles import value

times = st.floats(0, 100)
levels = st.floats(-50, 50)
points = st.lists(st.tuples(times, levels), min_size=1, max_size=6).map(
    lambda pairs: tuple(sorted(pairs, key=lambda p: p[0]))
)


@given(points, st.floats(-10, 200))
def test_a_profile_stays_between_its_points(pairs, time):
    levels = [value for _, value in pairs]
    assert min(levels) - 1e-9 <= value(Profile(pairs), time) <= max(levels) + 1e-9


@given(points)
def test_the_ends_are_held(pairs):
    assert value(Profile(pairs), pairs[0][0] - 1) == pairs[0][1]
    assert value(Profile(pairs), pairs[-1][0] + 1) == pairs[-1][1]


def test_between_two_points_it_is_a_straight_line():
    ramp = Profile(((1.0, 10.0), (3.0, 20.0)))
    assert [value(ramp, t) for t in (1.0, 1.5, 2.0, 3.0)] == [10.0, 12.5, 15.0, 20.0]


def test_two_points_at_one_time_are_a_step_and_the_later_one_holds_from_there():
    step = Profile(((0.0, 1.0), (2.0, 1.0), (2.0, 5.0)))
    assert value(step, math.nextafter(2.0, 0.0)) == 1.0
    assert value(step, 2.0) == 5.0


def test_a_sine_acts_from_its_start_to_its_end_only():
    """A quarter period of 0.5 Hz after the start it is at its amplitude."""
    wave = Profile(((0.0, 2.0),), Sine(amplitude=3.0, frequency_hz=0.5, start_s=4.0, end_s=6.0))
    assert value(wave, 3.9) == 2.0
    assert value(wave, 4.5) == pytest.approx(5.0)
    assert value(wave, 5.5) == pytest.approx(-1.0)
    assert value(wave, 6.0) == 2.0
