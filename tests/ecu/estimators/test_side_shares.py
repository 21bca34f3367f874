"""How an axle's lateral force is divided over its wheels: by loads, slips, and a stiffness that grows less than the load."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ecu.calibration import load_calibration
from ecu.estimators.tyres.tyre import cornering_stiffness
from ecu.estimators.tyres.wheels import radius, shared

WHEEL = load_calibration("l60").parameters.wheel
loads, slips = st.floats(1e3, 9e4), st.floats(-0.5, 0.5)
unhurried = settings(deadline=None, max_examples=50)


@pytest.mark.parametrize("load", [3e3, 1e4, 3.4e4, 8e4, 1.2e5])
def test_the_stiffness_is_that_of_the_tyres_data_sheet(load):
    """Magic Formula: 11 Fz0 sin(2 arctan(Fz / (2.4 Fz0))), 7.8 of the load at the nominal one."""
    sheet = 11.0 * 34e3 * math.sin(2.0 * math.atan(load / (2.4 * 34e3)))
    assert cornering_stiffness(load, WHEEL) == pytest.approx(sheet, rel=0.02)
    assert cornering_stiffness(-load, WHEEL) == 0.0


@unhurried
@given(st.floats(-5e4, 5e4), loads, loads, slips, slips)
def test_the_shares_make_up_the_axles_force_and_are_alike_in_the_mirror(total, left, right, a, b):
    one, other = shared(total, left, right, a, b, WHEEL)
    assert one + other == pytest.approx(total, abs=1e-6)
    assert shared(total, right, left, b, a, WHEEL) == pytest.approx((other, one), abs=1e-6)


@unhurried
@given(loads, slips)
def test_equal_wheels_share_alike(load, slip):
    assert shared(2e4, load, load, slip, slip, WHEEL) == pytest.approx((1e4, 1e4))


@unhurried
@given(st.floats(1e3, 4e4), st.floats(1.1, 4.0), st.floats(0.0, 0.2))
def test_the_more_loaded_wheel_gets_less_than_its_share_of_the_load(light, ratio, slip):
    heavy_force, light_force = shared(1e4, ratio * light, light, slip, slip, WHEEL)
    assert 0.5e4 < heavy_force < 1e4 * ratio / (1.0 + ratio) * (1.0 + 1e-9)
    assert light_force > 0.0


def test_at_small_slip_the_stiffnesses_share_and_when_sliding_the_loads():
    """90 and 10 kN: by load 9 to 1, by the sheet's stiffnesses 4.1 to 1."""
    small = shared(1e4, 9e4, 1e4, 1e-6, 1e-6, WHEEL._replace(lateral_peak=1e3))
    stiff = [math.sin(2.0 * math.atan(load / (2.4 * 34e3))) for load in (9e4, 1e4)]
    assert small[0] / small[1] == pytest.approx(stiff[0] / stiff[1], rel=1e-2)
    sliding = shared(1e4, 9e4, 1e4, 5.0, 5.0, WHEEL)
    assert sliding[0] / sliding[1] == pytest.approx(9.0)


def test_the_slower_wheel_of_a_turn_slides_at_the_larger_angle():
    left, right = shared(1e4, 3e4, 3e4, 0.06, 0.04, WHEEL)
    assert left > right


def test_a_wheel_in_the_air_pushes_nothing():
    assert shared(1e4, 0.0, 3e4, 0.1, 0.1, WHEEL) == (0.0, 1e4)
    assert shared(1e4, -5.0, 0.0, 0.1, 0.1, WHEEL) == (5e3, 5e3)


@given(st.floats(-1e12, 1e12))
def test_a_wheel_keeps_a_radius_under_any_load(normal):
    """Beyond the rim the closed form has a pole; a radius there would make any speed of a wheel's."""
    unloaded = WHEEL.unloaded_radius
    assert 0.7 * unloaded < radius(normal, 1.0, WHEEL) < 1.2 * unloaded
