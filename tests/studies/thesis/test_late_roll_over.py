"""The claims of docs/thesis/late-roll-over.md, against the facts the thesis reports."""

import math

import pytest

from hil.verdict import WHEELS
from studies.thesis.late_roll_over import measure
from studies.thesis.split import SPLITS, Split


@pytest.fixture(scope="module")
def left():
    return measure()


def test_the_front_left_wheel_lifts_first_and_the_machine_goes_over(left):
    assert WHEELS[left.lift_off.wheel] == "front left"
    assert left.rolls_over


def test_printed_it_names_the_wheel_less_than_a_second_late(left):
    assert left.seen["printed"].wheel == left.lift_off.wheel
    assert 0.3 < left.late("printed") < 1.0


def test_printed_it_knows_of_the_turn_through_the_roll_angle_alone(left):
    assert left.late("printed, roll angle unknown") == math.inf


def test_the_centripetal_acceleration_is_what_makes_it_late(left):
    assert left.late("centripetal acceleration alone (E-18)") < left.late("printed") - 0.3
    assert left.late("pivot arm alone (E-15)") > left.late("printed")


def test_corrected_it_is_ahead_and_foresees(left):
    assert left.seen["corrected"].wheel == left.lift_off.wheel
    assert -0.3 < left.late("corrected") < 0.0
    assert left.lift_off.time - left.foreseen > 0.8


def test_to_the_right_it_is_mirrored(left):
    right = measure(side=-1.0)
    assert WHEELS[right.lift_off.wheel] == "front right"
    assert right.late("printed") == pytest.approx(left.late("printed"), abs=0.05)


@pytest.mark.parametrize("split", [Split(-885.0, 0.12), Split(885.0, 0.12)], ids=str)
def test_late_and_ahead_whatever_the_split(split):
    assert split in SPLITS
    run = measure(split)
    assert 0.3 < run.late("printed") < 1.0
    assert run.late("corrected") < 0.0
