"""The permitted speed on a slope: the headings that a turn leads to count, not only the present one."""

import math

import pytest

from ecu.calibration import load_calibration
from ecu.estimators.acceleration import Vector
from ecu.estimators.cog import front_unit
from ecu.estimators.rollover import laden, permitted_speed, permitted_speed_around, turned_gravity

P = load_calibration().parameters
MACHINE = laden(front_unit(-0.65, 0.82, 0.0, P.front, P.arm, P.bucket), P)
G, TURN, LOCK = 9.81, P.prediction.turn_ahead, 0.66
LEVEL = Vector(0.0, 0.0, G)


def uphill(angle):
    """What an accelerometer reads on a machine that stands nose up by `angle`."""
    return Vector(G * math.sin(angle), 0.0, G * math.cos(angle))


def test_turning_on_the_spot_turns_gravity_the_other_way():
    """Nose up, a quarter turn to the left brings the right side up: the reading points to the right."""
    turned = turned_gravity(uphill(0.15), math.pi / 2)
    assert turned == pytest.approx((0.0, -G * math.sin(0.15), G * math.cos(0.15)), abs=1e-12)
    assert turned_gravity(turned, -math.pi / 2) == pytest.approx(uphill(0.15), abs=1e-12)


@pytest.mark.parametrize("yaw_rate", [-0.8, 0.0, 0.8])
def test_on_the_level_every_heading_is_alike(yaw_rate):
    assert permitted_speed_around(LOCK, LEVEL, yaw_rate, 1.0, MACHINE) == permitted_speed(
        LOCK, LEVEL, 1.0, MACHINE
    )


def test_driving_straight_only_the_present_heading_counts():
    slope = uphill(0.15)
    assert permitted_speed_around(LOCK, slope, 0.0, 1.0, MACHINE) == permitted_speed(
        LOCK, slope, 1.0, MACHINE
    )


def test_a_turn_that_will_point_its_outer_side_downhill_has_to_be_slower():
    """A left turn across the slope with the right side up: half a turn later its outer, right side is the lower one."""
    right_up = turned_gravity(uphill(0.15), math.pi / 2)
    now, later = (
        permitted_speed(LOCK, turned_gravity(right_up, turn), 1.0, MACHINE) for turn in (0.0, math.pi)
    )
    assert later < 0.9 * now
    assert permitted_speed_around(LOCK, right_up, math.pi / TURN, 1.0, MACHINE) == later
