"""Course and driver against geometry; turning circle and lock to lock against closed forms."""

import math

import numpy as np
import pytest

from hil.verdict import Result
from plant.plant import Plant
from studies.standards.course import (
    Course,
    double_lane_change,
    drive,
    points_ahead,
    slow_steering,
    straight,
    tyre_edges,
)
from studies.standards.steering import course_checks, lock_to_lock, turning_radius, width_across_tyres


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


def test_tyre_edges_of_the_straight_machine(candidate):
    g, half = candidate.machine.geometry, width_across_tyres(candidate.machine) / 2.0
    edges = tyre_edges(candidate.machine, Plant(candidate.machine).truth())
    expected = [(x, y) for x in (g.front_axle_x, g.rear_axle_x) for y in (half, -half)]
    np.testing.assert_allclose(edges, expected, atol=5e-3)  # it stands a little pitched


def test_a_straight_course_is_driven_straight(candidate):
    done = drive(Plant(candidate.machine, speed=4.0), straight(30.0), 4.0)
    assert done.finished
    assert done.departure.max() == pytest.approx(width_across_tyres(candidate.machine) / 2.0, abs=1e-3)


def test_a_machine_that_cannot_steer_leaves_the_corridor(l60):
    stiff = slow_steering(l60.machine, 0.05)
    done = drive(Plant(stiff, speed=4.0), double_lane_change(3.0, 15.0), 4.0)
    departed, _ = course_checks("stiff", done, 14.4, 1.5)
    assert departed.result is not Result.PASSED


@pytest.mark.parametrize("share", [0.3, 1.0])
def test_lock_to_lock_takes_the_way_over_the_rate(candidate, share):
    """No sooner than at the full rate all the way, no later than with lag and cushion one after the other."""
    steering = slow_steering(candidate.machine, share).steering
    way, left, rate = 1.99 * steering.limit, 0.01 * steering.limit, steering.rate_limit
    braked = rate * steering.cushion_time_constant  # where the cushion begins, from the stop
    cushion = steering.cushion_time_constant * max(math.log(braked / left), 0.0)
    latest = steering.time_constant + (way + left - braked) / rate + cushion
    assert way / rate < lock_to_lock(slow_steering(candidate.machine, share)) < latest + 0.01


def test_the_turning_radius_is_that_of_the_geometry(candidate):
    """Both axles' lines meet at angle delta: (l_r + l_f cos)/sin ahead, (l_f + l_r cos)/sin behind, and half the track."""
    g, lock = candidate.machine.geometry, candidate.machine.steering.limit
    ahead, behind = g.front_axle_x, -g.rear_axle_x
    front = (behind + ahead * math.cos(lock)) / math.sin(lock)
    rear = (ahead + behind * math.cos(lock)) / math.sin(lock)
    assert turning_radius(candidate.machine) == pytest.approx(max(front, rear) + g.track / 2.0, rel=0.005)


def test_the_driver_looks_as_far_as_the_machine_is_long(candidate):
    """4/3 of the wheelbase: 4 m for the L60."""
    g, course = candidate.machine.geometry, straight(30.0)
    seen = points_ahead(course, candidate.machine) * course.step
    assert seen == pytest.approx(4.0 * (g.front_axle_x - g.rear_axle_x) / 3.0, abs=course.step)
