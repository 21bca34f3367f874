"""Course and driver against geometry; turning circle and lock to lock against closed forms."""

import math

import numpy as np
import pytest

from hil.standards.course import Course, double_lane_change, drive, slow_steering, straight, tyre_edges
from hil.standards.steering import _checks, lock_to_lock, turning_radius, width_across_tyres
from hil.verdict import Result
from plant.plant import Plant


def test_the_course_goes_over_and_back():
    course = double_lane_change(3.0, 15.0)
    y = course.centre[:, 1]
    assert y[0] == y[-1] == 0.0
    assert y.max() == pytest.approx(3.0)
    assert np.all(np.diff(course.centre[:, 0]) > 0)
    over = course.centre[np.searchsorted(course.centre[:, 0], 17.5)]
    assert over[1] == pytest.approx(1.5, abs=0.02)


def test_departure_is_the_signed_distance():
    line = Course(np.column_stack((np.arange(0, 10, 0.1), np.arange(0, 10, 0.1))))
    assert line.departure(np.array((3.0, 4.0))) == pytest.approx(math.sqrt(0.5))
    assert line.departure(np.array((4.0, 3.0))) == pytest.approx(-math.sqrt(0.5))


def test_tyre_edges_of_the_straight_machine(l60):
    edges = tyre_edges(l60.machine, Plant(l60.machine).truth())
    half = width_across_tyres(l60.machine) / 2.0
    expected = [(1.5, half), (1.5, -half), (-1.5, half), (-1.5, -half)]
    np.testing.assert_allclose(edges, expected, atol=5e-3)  # it stands a little pitched


def test_a_straight_course_is_driven_straight(l60):
    done = drive(Plant(l60.machine, speed=4.0), straight(30.0), 4.0)
    assert done.finished
    assert done.departure.max() == pytest.approx(width_across_tyres(l60.machine) / 2.0, abs=1e-3)


def test_a_machine_that_cannot_steer_leaves_the_corridor(l60):
    stiff = slow_steering(l60.machine, 0.05)
    done = drive(Plant(stiff, speed=4.0), double_lane_change(3.0, 15.0), 4.0)
    departed, _ = _checks("stiff", done, 14.4, 1.5)
    assert departed.result is not Result.PASSED


@pytest.mark.parametrize("share", [0.3, 1.0])
def test_lock_to_lock_takes_the_way_over_the_rate(l60, share):
    """No sooner than at the full rate all the way, no later than with lag and cushion one after the other."""
    steering = slow_steering(l60.machine, share).steering
    way, left, rate = 1.99 * steering.limit, 0.01 * steering.limit, steering.rate_limit
    braked = rate * steering.cushion_time_constant  # where the cushion begins, from the stop
    cushion = steering.cushion_time_constant * max(math.log(braked / left), 0.0)
    latest = steering.time_constant + (way + left - braked) / rate + cushion
    assert way / rate < lock_to_lock(slow_steering(l60.machine, share)) < latest + 0.01


def test_the_turning_radius_is_that_of_the_geometry(l60):
    """l/tan(delta/2) to the axle's middle with the joint midway, and half the track to the outer tyre."""
    g, lock = l60.machine.geometry, l60.machine.steering.limit
    expected = g.front_axle_x / math.tan(lock / 2.0) + g.track / 2.0
    assert turning_radius(l60.machine) == pytest.approx(expected, rel=0.01)
