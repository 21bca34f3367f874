"""Why the lift-off is seen later than a planar theory has it: the free axle is not the cause, the tyres' grip is."""

import math

import pytest

from studies.thesis.late_causes import FRICTIONS, STOPS_DEG, THEORY, measure, quick, stopped_at, turn
from studies.thesis.split import SHEET, machine_of


@pytest.fixture(scope="module")
def by_friction():
    return {friction: measure(turn(friction=friction)) for friction in FRICTIONS}


def test_the_rear_axle_touches_its_stop_after_the_printed_form_has_seen_the_lift_off(by_friction):
    for found in by_friction.values():
        assert found.late < found.stopped


@pytest.mark.parametrize("angle", STOPS_DEG[1:3])
def test_another_stop_changes_nothing(angle, by_friction):
    found = measure(turn(), stopped_at(machine_of(SHEET), angle))
    assert found.stopped < by_friction[0.75].stopped
    assert found.late == pytest.approx(by_friction[0.75].late, abs=0.03)


def test_an_axle_that_does_not_swing_keeps_the_machine_from_going_over():
    found = measure(turn(), stopped_at(machine_of(SHEET), 1.0))
    assert not found.rolls_over
    assert found.late == math.inf


def test_a_quicker_turn_changes_nothing(by_friction):
    found = measure(turn(turn_s=1.0), quick(machine_of(SHEET), 1.0))
    assert found.late == pytest.approx(by_friction[0.75].late, abs=0.03)


def test_the_more_grip_the_less_late_down_to_the_theory(by_friction):
    late = [by_friction[friction].late for friction in FRICTIONS]
    assert late == sorted(late, reverse=True)
    assert late[0] > 2.0 * late[-1]
    assert THEORY[0] < late[-1] < THEORY[1]


def test_with_less_grip_the_machine_rolls_more_slowly_when_the_wheel_lifts(by_friction):
    rates = [by_friction[friction].roll_rate for friction in FRICTIONS]
    assert rates == sorted(rates)
    assert rates[-1] > 2.0 * rates[0]
