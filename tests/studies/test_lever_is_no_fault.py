"""A lift lever that is let go full: a drive in which only the lift pressure jumps, and in which no sensor is wrong."""

import numpy as np

from ecu.calibration import load_calibration
from ecu.detection.layout import JUMP, SAMPLE, STIRRED
from ecu.watched import LIFT, PITCH_RATE
from hil.compose import calibration_of
from studies.campaigns.manoeuvres import Manoeuvre, scenario_of
from studies.campaigns.wrong_calibration import wrong_calibration
from studies.faults.drives import Detector, driven

DRIVE = Manoeuvre(
    kind="levers", speed_kmh=18.5, payload_kg=2911, arm_deg=-17.1, angle_deg=-24.6, rate_deg_s=27.0, seed=726892230,
    calibration_seed=231788798, lift_percent=100.0, ramp_s=0.01, held_s=1.07,
)  # fmt: skip
LET_GO = slice(349, 356)
"""Ticks around the release of the lever, 0.05 s before and after."""


def test_an_arm_that_stops_is_no_fault_of_its_pressure():
    scenario = scenario_of(DRIVE)
    name = calibration_of(scenario)
    right = load_calibration(name)
    watched = driven(scenario, wrong_calibration(name, DRIVE.calibration_seed))
    detector = Detector(right, right.parameters)
    heard = watched.heard[LET_GO, LIFT] == SAMPLE
    jumps = np.diff(watched.samples[LET_GO, LIFT][heard])
    assert np.abs(jumps).max() > detector.rules[JUMP, LIFT], "the pressure jumps"
    pitching = np.abs(np.diff(watched.samples[LET_GO, PITCH_RATE]))
    assert pitching.max() < detector.rules[STIRRED, PITCH_RATE], "no sample of the gyro is beyond noise"
    assert watched.reported == ()
    assert detector.run(watched.samples, watched.heard, watched.usable).begins() == []
