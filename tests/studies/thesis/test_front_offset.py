"""The claims of docs/thesis/front-offset.md, against statics and the facts the thesis reports."""

import math

import numpy as np
import pytest

from studies.thesis.front_offset import ANGLE, measure, offsets, slope
from studies.thesis.split import SPLITS

WALK = 1.0


@pytest.fixture(scope="module")
def walk():
    return measure(WALK)


def test_the_printed_offset_changes_sign_with_the_articulation(walk):
    printed = walk.offsets["printed"]
    assert printed.front_left < -4e3
    assert printed.front_right == pytest.approx(-printed.front_left, rel=0.05)


def test_its_size_is_that_of_the_pivot_forces_missing_arm(walk):
    """Sheet's lumps: 4382 kg at 1.822 m before the joint, 6018 kg behind it; F_R from the standing rear wheels; t = 1.93 m."""
    mass, moment = 4382.0 + 6018.0, 4382.0 * 1.822
    pivot = 2 * 31.1e3 - 1442.0 * 9.81
    offset = pivot * moment * math.sin(ANGLE) / mass / 1.93
    assert -walk.offsets["printed"].odd == pytest.approx(offset, rel=0.2)
    assert slope(walk) == pytest.approx(1.0, abs=0.15)


def test_the_rear_wheels_hardly_show_it(walk):
    printed = walk.offsets["printed"]
    assert abs(printed.rear_left) < 0.1 * abs(printed.front_left)
    assert abs(printed.rear_right) < 0.1 * abs(printed.front_right)


def test_the_corrected_form_keeps_less_than_a_fiftieth(walk):
    corrected, printed = walk.offsets["corrected"], walk.offsets["printed"]
    assert abs(corrected.odd) < abs(printed.odd) / 50
    assert abs(corrected.front_left) < 150.0


def test_with_the_arm_alone_it_is_gone_at_a_walk(walk):
    """What is left is the centripetal acceleration's, a sixth of the arm's at 1 m/s; with both, next to nothing."""
    printed = abs(walk.offsets["printed"].odd)
    assert abs(walk.offsets["pivot arm alone (E-15)"].odd) < printed / 5
    assert abs(walk.offsets["pivot arm and centripetal acceleration (E-18)"].odd) < printed / 25


def test_faster_the_missing_centripetal_acceleration_takes_it_back_as_the_square_of_the_speed(walk):
    """The change from 1 m/s grows 1:8 from 2 to 3 m/s (4 - 1 to 9 - 1 square metres per square second are 3 to 8)."""
    odd = {speed: measure(speed).offsets["printed"].odd for speed in (2.0, 3.0, 4.0)}
    start = walk.offsets["printed"].odd
    assert (odd[3.0] - start) / (odd[2.0] - start) == pytest.approx(8 / 3, rel=0.1)
    assert odd[4.0] > 0 > odd[3.0]


@pytest.mark.parametrize("split", [SPLITS[4], SPLITS[8]], ids=str)
def test_sign_and_size_stand_whatever_the_split(split):
    run = measure(WALK, split)
    assert -7e3 < run.offsets["printed"].odd < -5e3
    assert abs(run.offsets["corrected"].odd) < 150.0


def test_an_offset_is_half_the_difference_of_the_pair_over_the_held_turns():
    angle = np.array([0.0, ANGLE, -ANGLE, 0.5 * ANGLE])
    error = np.array([[9.0, 9, 9, 9], [1, 3, 2, 2], [5, 1, 0, 4], [9, 0, 9, 0]])
    found = offsets(error, angle)
    assert (found.front_left, found.front_right, found.rear_left, found.rear_right) == (-1.0, 2.0, 0.0, -2.0)
    assert found.odd == -1.5
