"""Slope of a recording: the reading less what accelerations add to it, and as it is where that cannot be known."""

import math

import numpy as np
import pytest

from discrepancy.models.printed_slope import NEEDED, without_lean
from discrepancy.signals.recording import Recording, signal
from ecu.calibration import load_calibration
from ecu.estimators.tyres.wheels import radius

P = load_calibration("l60").parameters
TIME = np.arange(0.0, 10.0, 0.04)
WHEEL, YAW = 5.0, 0.4  # of a machine that turns to the left evenly [rad/s]
SENSOR = P.geometry.rear_length + P.sensors.imu_x
ASIDE = WHEEL * radius(P.wheel.nominal_load, 1.0, P.wheel) * YAW


def turning(slope=0.0, **other):
    """On ground that is level but for a roll of `slope`; other: readings that replace one."""
    across = math.atan2(ASIDE + 9.81 * math.sin(slope), 9.81 * math.cos(slope))
    ahead = -(YAW**2) * SENSOR
    along = math.atan2(-ahead, math.hypot(ASIDE + 9.81 * math.sin(slope), 9.81 * math.cos(slope)))
    readings = dict(zip(NEEDED, (along, across, YAW, WHEEL, WHEEL), strict=True)) | other
    return Recording(
        "turn", {name: signal(TIME, value + 0.0 * TIME, "1") for name, value in readings.items()}
    )


@pytest.mark.parametrize("slope", [0.0, 0.05])
def test_an_even_turn_leans_the_reading_and_the_slope_remains(slope):
    last = {name: item.value[-1] for name, item in without_lean(turning(slope)).items()}
    assert last["roll_angle"] == pytest.approx(slope, abs=2e-3)
    assert last["pitch_angle"] == pytest.approx(0.0, abs=2e-3)
    assert last["yaw_rate"] == YAW


def test_a_machine_that_goes_straight_at_one_speed_is_read_as_it_is():
    straight = turning(0.1, pitch_angle=0.02, roll_angle=0.1, yaw_rate=0.0)
    found = without_lean(straight)
    assert all(found[name].value == pytest.approx(straight.signals[name].value) for name in NEEDED)


def test_a_sample_that_is_no_number_spoils_no_other():
    damaged = turning()
    damaged.signals["yaw_rate"].value[40] = math.nan
    damaged.signals["roll_angle"].value[50] = math.nan
    found, sound = without_lean(damaged), without_lean(turning())
    lost = np.isnan(found["roll_angle"].value)
    assert np.flatnonzero(lost).tolist() == [50]
    assert found["roll_angle"].value[~lost] == pytest.approx(sound["roll_angle"].value[~lost])


@pytest.mark.parametrize("name", NEEDED)
def test_without_one_of_the_signals_nothing_is_taken_off(name):
    run = turning()
    fewer = Recording("fewer", {other: item for other, item in run.signals.items() if other != name})
    assert without_lean(fewer) == fewer.signals
