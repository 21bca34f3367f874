"""The laws of the verdict: what counts as lift-off, warning, lead, false alarm and prevention."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.compose import standing_loads
from hil.verdict import (
    WARNING_MIN_S,
    Result,
    RunVerdict,
    first_lift_off,
    first_true,
    flickers,
    judge,
    judge_prevention,
    judge_warning,
    lasting,
    roll_over_warning,
)
from plant.unit.scenario import load_scenario

TIME = np.arange(0, 5, 0.01)
STANDING = np.array([30e3, 31e3, 28e3, 29e3])


def forces(wheel=None, start=0, stop=0):
    force = np.tile(STANDING, (TIME.size, 1))
    if wheel is not None:
        force[start:stop, wheel] = 0
    return force


def run(force, warned_s=None, roll=0.0, ratio=0.0, standing=STANDING) -> RunVerdict:
    fill = np.full(TIME.size, 1.0)
    return judge(
        time_s=TIME, normal_force=force, roll=roll * fill, load_transfer_ratio=ratio * fill, warned_s=warned_s,
        standing=standing,
    )  # fmt: skip


@given(st.integers(0, 3), st.integers(10, 400), st.integers(7, 50))
def test_a_wheel_without_load_for_more_than_50_ms_has_lifted_when_the_load_vanished(wheel, start, length):
    lift = first_lift_off(TIME, forces(wheel, start, start + length))
    assert lift == (TIME[start], wheel)


@given(st.integers(0, 3), st.integers(10, 400), st.integers(1, 5))
def test_shorter_loss_of_contact_is_wheel_hop(wheel, start, length):
    assert first_lift_off(TIME, forces(wheel, start, start + length)) is None


def test_a_wheel_that_hops_and_then_lifts_lifted_the_second_time():
    force = forces(0, 100, 103)
    force[200:300, 0] = 0
    assert first_lift_off(TIME, force) == (TIME[200], 0)


def test_of_several_wheels_the_first_to_lift_counts():
    force = forces(0, 150, 300)
    force[140:300, 2] = 0
    assert first_lift_off(TIME, force) == (TIME[140], 2)


def test_a_load_that_is_not_a_number_is_no_contact():
    force = forces()
    force[100:200, 3] = np.nan
    assert first_lift_off(TIME, force) == (TIME[100], 3)


@given(st.floats(0.1, 4.9))
def test_lead_is_positive_exactly_when_the_warning_came_first(warned_s):
    verdict = run(forces(0, 250, 400), warned_s)
    assert verdict.lead_s == pytest.approx(TIME[250] - warned_s)
    assert verdict.warned_in_time == (warned_s < TIME[250])
    assert judge_warning(verdict).result is (Result.PASSED if warned_s < TIME[250] else Result.FAILED)


def test_lift_off_without_any_warning_fails_and_no_lift_off_decides_nothing():
    assert judge_warning(run(forces(0, 250, 400))).result is Result.FAILED
    assert judge_warning(run(forces(), 1.0)).result is Result.INCONCLUSIVE


@pytest.mark.parametrize(("share", "alarm"), [(0.5, True), (0.31, True), (0.29, False), (0.05, False)])
def test_a_warning_is_false_only_while_every_wheel_keeps_more_than_30_percent(share, alarm):
    force = forces()
    force[100, 2] = share * STANDING[2]
    assert run(force, 0.9).false_alarm is alarm
    assert not run(force).false_alarm


def test_a_lift_off_is_never_a_false_alarm():
    assert not run(forces(1, 100, 300), 0.5).false_alarm


def test_margin_is_the_smallest_share_of_standing_load():
    force = forces()
    force[77, 1] = 0.4 * STANDING[1]
    force[78, 3] = 0.7 * STANDING[3]
    assert run(force).margin == pytest.approx(0.4)


def test_a_run_that_starts_on_a_bank_is_measured_by_level_ground():
    """The wheel on the upper side carries half from the first sample on: a margin of a half, not of one."""
    start = STANDING * np.array((0.5, 1.5, 0.5, 1.5))
    assert run(np.tile(start, (TIME.size, 1))).margin == pytest.approx(0.5)


def test_standing_loads_do_not_know_the_slope_where_a_run_starts():
    """27.0 and 31.1 kN a wheel, front and rear: the sheet of the empty machine."""
    level = load_scenario("standstill")
    bank = replace(level, surface=replace(level.surface, bank=0.2))
    assert standing_loads(bank) == standing_loads(level)
    assert standing_loads(bank) == pytest.approx((27.0e3, 27.0e3, 31.1e3, 31.1e3), rel=0.01)


@pytest.mark.parametrize("level", [np.zeros(4), np.array((3e4, 3e4, -1.0, 3e4))])
def test_loads_that_no_machine_has_standing_are_refused(level):
    with pytest.raises(ValueError, match="level ground"):
        run(forces(), standing=level)


@pytest.mark.parametrize("roll", [0.80, -0.80])
def test_beyond_45_degrees_it_has_rolled_over_on_either_side(roll):
    assert run(forces(), roll=roll).rolled_over
    assert not run(forces(), roll=0.9 * roll).rolled_over


def test_only_a_valid_estimate_of_at_least_warning_warns():
    state = np.array([0, 1, 2, 3, 4, 7, 3])
    valid = np.array([1, 1, 1, 1, 1, 1, 0])
    assert roll_over_warning(state, valid).tolist() == [False, False, True, True, True, False, False]


@given(st.integers(0, 400), st.integers(1, 60))
def test_a_warning_counts_from_its_first_frame_if_it_stands_for_50_ms(start, frames):
    warns = np.zeros(TIME.size, bool)
    warns[start : start + frames] = True
    counts = frames > 5  # the sixth frame is 50 ms after the first
    assert lasting(TIME, warns, WARNING_MIN_S) == ([TIME[start]] if counts else [])
    assert flickers(TIME, warns, WARNING_MIN_S) == (0 if counts else 1)


def test_flicker_before_a_warning_does_not_make_it_earlier():
    warns = np.zeros(TIME.size, bool)
    warns[[50, 52, 53, 60]] = True
    warns[100:150] = True
    assert lasting(TIME, warns, WARNING_MIN_S) == [TIME[100]]
    assert flickers(TIME, warns, WARNING_MIN_S) == 3


def test_a_warning_that_the_records_end_cuts_off_is_no_flicker():
    warns = np.zeros(TIME.size, bool)
    warns[-2:] = True
    assert flickers(TIME, warns, WARNING_MIN_S) == 0


def test_first_true():
    assert first_true([0.0, 0.5, 1.0], [False, True, True]) == 0.5
    assert first_true([0.0, 0.5], [False, False]) is None


def test_prevention_needs_something_to_prevent():
    lifts, stays = run(forces(0, 250, 400)), run(forces())
    assert judge_prevention(lifts, stays).result is Result.PASSED
    assert judge_prevention(lifts, lifts).result is Result.FAILED
    assert judge_prevention(stays, stays).result is Result.INCONCLUSIVE
    assert judge_prevention(lifts, replace(stays, rolled_over_s=3.0)).result is Result.FAILED


def test_an_empty_run_or_one_that_starts_in_the_air_cannot_be_judged():
    with pytest.raises(ValueError, match="no sample"):
        judge(
            time_s=[],
            normal_force=np.empty((0, 4)),
            roll=[],
            load_transfer_ratio=[],
            warned_s=None,
            standing=STANDING,
        )
    with pytest.raises(ValueError, match="stand on the ground"):
        run(forces(0, 0, 100))
