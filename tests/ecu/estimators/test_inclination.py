"""Slope from a sensor that feels accelerations, and forces of wheels whose brakes hold them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ecu.calibration import load_calibration
from ecu.estimators.balance import MOVING, held, with_held
from ecu.estimators.columns import estimate_columns
from ecu.estimators.inclination import (
    MOST_TRUST,
    Slope,
    apparent,
    followed_speed,
    lean_at_start,
    leaned,
    without,
)
from ecu.estimators.quantities import WheelForces
from ecu.estimators.signals import Estimates, Inputs
from ecu.estimators.state import INITIAL
from tests.ecu.machine import STANDING

PARAMETERS = load_calibration().parameters
DT = 0.01
G = 9.81
unhurried = settings(deadline=None)
slopes = st.floats(-0.4, 0.4)


@unhurried
@given(slopes, slopes)
def test_a_machine_that_does_not_accelerate_shows_its_slope(pitch, roll):
    assert apparent(Slope(pitch, roll), 0.0, 0.0) == pytest.approx((pitch, roll), abs=1e-12)


@unhurried
@given(st.floats(-5.0, 5.0))
def test_on_level_ground_the_tangent_is_acceleration_over_gravity(a):
    """Nose up is negative: acceleration ahead feels like a climb."""
    ahead, aside = apparent(Slope(0.0, 0.0), a, 0.0), apparent(Slope(0.0, 0.0), 0.0, a)
    assert math.tan(ahead.pitch) == pytest.approx(-a / 9.80665, rel=2e-3)
    assert math.tan(aside.roll) == pytest.approx(a / 9.80665, rel=2e-3)


def test_known_accelerations_free_the_reading_of_its_lean():
    """A sensor of the same law, integrated ten times as finely: its reading without the lean is the slope."""
    time, slope = 1.0, Slope(0.05, -0.08)
    inside = lean = lean_at_start(0.0)
    worst = 0.0
    for k in range(1000):
        ahead, aside = 3.0 * math.sin(0.01 * k), 2.0 * (k > 300)
        for _ in range(10):
            felt = apparent(slope, ahead, aside)
            inside = Slope(
                inside.pitch + DT / 10 / time * (felt.pitch - slope.pitch - inside.pitch),
                inside.roll + DT / 10 / time * (felt.roll - slope.roll - inside.roll),
            )
        reading = Slope(slope.pitch + inside.pitch, slope.roll + inside.roll)
        lean = leaned(lean, slope, ahead, aside, DT, time)
        freed = without(reading, lean)
        worst = max(worst, abs(freed.pitch - slope.pitch), abs(freed.roll - slope.roll))
    assert abs(inside.roll) > 0.19  # the reading itself is wrong by ten degrees
    assert worst < 2e-3


@pytest.mark.parametrize("wheels", [-3.0, 0.0, 5.0])
def test_the_speed_of_the_correction_trusts_wheels_within_limits(wheels):
    moved = followed_speed(1.0, 0.02, wheels, DT) - 1.02
    assert moved * (wheels - 1.0) > 0.0
    assert abs(moved) <= MOST_TRUST * DT + 1e-15


def drive(seconds, **series):
    """Inputs of a machine on level ground; series: values by input, numbers or arrays."""
    n = round(seconds / DT)
    rows = np.zeros((n, len(Inputs._fields)))
    for k, name in enumerate(Inputs._fields):
        if name.endswith("usable"):
            rows[:, k] = 1.0
        elif name.endswith("limit"):
            rows[:, k] = math.inf
        else:
            rows[:, k] = series.get(name, STANDING.get(name, 0.0))
    rows[:, 0] = DT
    return rows


def test_a_machine_that_stands_keeps_its_slope_with_biased_accelerometers():
    """The fused speed takes its acceleration from the slope: alone, both would drift off together."""
    rows = drive(60.0, specific_force_x=0.05)
    found = estimate_columns(rows, PARAMETERS, prediction=False)
    pitch = found[:, Estimates._fields.index("slope_pitch")]
    assert np.abs(pitch).max() < math.radians(0.5)
    assert np.abs(pitch[-1000:]).max() < math.radians(0.1)


wheels = st.tuples(*[st.floats(-10e3, 10e3)] * 4)


@unhurried
@given(wheels, st.floats(-60e3, 60e3), st.floats(-0.6, 0.6), st.floats(-20e3, 20e3))
def test_held_wheels_bear_what_the_others_leave_of_the_push(own, push, angle, side):
    """The balance along the rear frame closes, shared by load; a wheel that turns keeps its own."""
    given_inputs = dict.fromkeys(Inputs._fields, 0.0) | {
        "articulation_angle": angle, "demand_usable": 1.0, "brake_demand": 0.5, "wheel_speed_2": 3.0,
    }  # fmt: skip
    s = INITIAL._replace(normal_1=20e3, normal_2=30e3, normal_3=10e3, normal_4=40e3, front_side=side)
    x = with_held(Inputs(**given_inputs), s, push, WheelForces(*own, 0.0, 0.0, 0.0, 0.0), PARAMETERS.wheel)
    along = (x.x1 + x.x2) * math.cos(angle) - side * math.sin(angle) + x.x3 + x.x4
    assert along == pytest.approx(push, abs=1e-6)
    assert x.x2 == own[1]
    assert x.x1 * 10e3 == pytest.approx(x.x3 * 20e3, abs=1e-2)
    assert x.x4 * 10e3 == pytest.approx(x.x3 * 40e3, abs=1e-2)


@pytest.mark.parametrize(
    ("wheel_speed", "speed", "braked", "known", "expected"),
    [
        (0.0, 0.0, 0.5, 1.0, 1.0),  # a brake on
        (0.0, 0.0, 0.0, 1.0, 0.0),  # stalled in a pile by its own drive: its torque is known
        (0.0, 0.0, 0.0, 0.0, 1.0),  # demand unknown: it may be braked
        (0.0, 2.0 * MOVING, 0.0, 1.0, 1.0),  # locked by the limits' brake
        (1.0, 0.0, 1.0, 1.0, 0.0),  # turns
    ],
)
def test_a_wheel_is_held_only_when_a_brake_may_hold_it(wheel_speed, speed, braked, known, expected):
    i = Inputs(**(dict.fromkeys(Inputs._fields, 0.0) | {"brake_demand": braked, "demand_usable": known}))
    assert held(i, wheel_speed, speed) == expected
