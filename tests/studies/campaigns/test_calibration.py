"""The Monte Carlo over wrong calibrations: its ECU is the run's own, and the page says what its figures say."""

import dataclasses

import numpy as np
import pytest

from dbc import loader_database
from ecu.calibration import load_calibration
from ecu.cycle import EcuCycle
from hil.compose import Choice, calibration_of, lockstep
from hil.verdict import Result
from studies.campaigns.calibration import calibrations, heard, turns
from studies.campaigns.calibration_page import calm, drive_row, lifting, suites, turn_table
from studies.campaigns.roll_over import CONFIRMATION

ECU_IDS = {m.can_id for m in loader_database().by_name.values() if "EstimatorEcu" in m.senders}


def test_an_ecu_that_hears_the_recorded_bus_sends_what_the_runs_own_sent():
    scenario = dataclasses.replace(Choice(scenario="abrupt_articulation").load(), duration_s=1.5)
    recording = lockstep(scenario, limits=False, reference=False).run()
    ecu = EcuCycle(load_calibration(calibration_of(scenario)), limits_enabled=False)
    again = heard(recording.bus, ecu)
    for can_id in ECU_IDS:  # the bus sends the frames of a cycle in the order of their identifiers
        own = [frame.data for frame in recording.bus if frame.can_id == can_id]
        # the last cycle of the run may come after its last frame
        assert [frame.data for frame in again if frame.can_id == can_id][: len(own)] == own
    assert sum(frame.can_id in ECU_IDS for frame in recording.bus) > 500


def test_the_right_calibration_comes_first_and_seeds_give_the_others():
    right, *wrong = calibrations("l60", 5, 3)
    assert right.parameters == load_calibration("l60").parameters
    assert len({c.parameters.front.mass for c in (right, *wrong)}) == 4
    assert [c.parameters for c in calibrations("l60", 6, 2)[1:]] == [c.parameters for c in wrong[1:]]


def test_turns_are_drawn_from_the_grid_without_repetition():
    drawn = turns(30, 3)
    assert len(set(drawn)) == 30
    assert set(drawn) <= set(CONFIRMATION.cases())
    assert turns(30, 3) == drawn != turns(30, 4)


TURNED = [
    {"lift_off_s": 3.0, "margin": 0.0, "leads_s": [1.0, 0.8, 0.4], "false_alarms": [False] * 3},
    {"lift_off_s": 4.0, "margin": 0.0, "leads_s": [0.9, None, -0.1], "false_alarms": [False] * 3},
    {"lift_off_s": None, "margin": 0.9, "leads_s": [None] * 3, "false_alarms": [False, True, False]},
    {"lift_off_s": None, "margin": 0.01, "leads_s": [None] * 3, "false_alarms": [False] * 3},
]
DRIVEN = [{"worst": [0.02, *np.linspace(0.03, 0.07, 101)], "payload": [10.0, 50.0, 70.0, 60.0]}]


def test_late_and_missing_warnings_and_false_alarms_are_counted_apart():
    assert (len(lifting(TURNED)), len(calm(TURNED))) == (2, 1)  # the last turn deserves a warning
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in turn_table(TURNED).splitlines()]
    assert ["lift-offs announced late or never", "0 of 2", "2 of 4"] in rows
    assert ["lead, least", "0.90 s", "-0.10 s"] in rows
    assert ["false alarms", "0 of 1", "1 of 2"] in rows


def test_no_turn_leaves_questions_open():
    assert {case.result for case in suites([], [], [])[1].cases} == {Result.INCONCLUSIVE}
    assert "–" in turn_table([])


@pytest.mark.parametrize(("shift", "expected"), [(0.0, Result.PASSED), (0.02, Result.FAILED)])
def test_the_aim_is_for_95_of_100_wrong_calibrations(shift, expected):
    result = {"worst": [0.02, *(np.array(DRIVEN[0]["worst"][1:]) + shift)]}
    assert suites(["loaded"], [result], TURNED)[0].cases[0].result is expected


def test_a_row_has_median_and_95th_percentile_of_the_wrong_ones():
    assert drive_row("hard_braking", DRIVEN[0])[:4] == ["hard braking", "2.0 %", "5.0 %", "6.8 %"]
