"""Holding, tilting and crossing slopes against closed forms."""

import math

import pytest

from studies.standards.rest import lift_off_slope, rigid
from studies.standards.slope import across, creep, steepest_crossing


def test_the_brakes_hold_up_to_their_torque(candidate):
    """Torque that balances m g sin(slope) on all four loaded radii, and 20 % to either side of it."""
    machine, grade = candidate.machine, math.atan(0.25)
    radius = machine.geometry.wheel_centre_height
    needed = machine.mass * 9.81 * math.sin(grade) * radius / 4.0
    assert creep(candidate, grade, 0.0, (1.2 * needed,) * 4) < 0.02
    assert creep(candidate, grade, 0.0, (0.8 * needed,) * 4) > 1.0


def test_a_slope_steeper_than_friction_cannot_be_held(l60):
    """Peak friction 0.8 of the asphalt tyre: 44 degrees have tan = 0.97."""
    assert creep(l60, math.radians(44.0), 0.0, (30e3,) * 4) == math.inf


def test_the_tilt_of_a_straight_machine_by_the_three_point_support(l60):
    """Empty and straight: the line from a front contact to the pivot; machine sheet 4: 0.66 g."""
    assert lift_off_slope(rigid(l60.machine), 0.0, 0.0, None, 1) == pytest.approx(0.66, rel=0.02)


def test_a_crossing_is_less_than_the_tilt_table_and_level_ground_keeps_every_load(l60):
    """Driving uphill of the line articulates and swings: it can only be worse than standing straight."""
    tilt = math.degrees(math.atan(lift_off_slope(l60.machine, 0.0, 0.0, None, 1)))
    steepest = steepest_crossing(l60, 0.0)
    assert 0.6 * tilt < steepest < tilt
    assert across(l60, 0.0, 1e-9)[1].min() > 0.9
