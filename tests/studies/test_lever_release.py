"""Levers that are let go in a turn: drives of the prevention campaign in which both rear wheels once lifted."""

import pytest

from studies.campaigns.manoeuvres import Manoeuvre
from studies.campaigns.prevention import driven

DRIVES = {
    "down and forward for 2 s": Manoeuvre(
        kind="levers", speed_kmh=18.8, payload_kg=3204, arm_deg=19.8, angle_deg=30.3, rate_deg_s=18.8, seed=1603074172,
        lift_percent=-100.0, tilt_percent=-100.0, ramp_s=0.01, held_s=1.97,
    ),
    "down for 1 s on slippery ground": Manoeuvre(
        kind="levers", speed_kmh=16.1, payload_kg=2699, arm_deg=11.2, angle_deg=-17.7, rate_deg_s=15.9, seed=321494177,
        lift_percent=-100.0, ramp_s=0.01, held_s=0.99, friction=0.45,
    ),
    "down and forward for 0.4 s, wrong calibration": Manoeuvre(
        kind="levers", speed_kmh=23.2, payload_kg=3204, arm_deg=5.0, angle_deg=12.4, rate_deg_s=18.0, seed=1263456809,
        calibration_seed=1322930596, lift_percent=-100.0, tilt_percent=-100.0, ramp_s=0.01, held_s=0.35, friction=0.81,
    ),
    "down and forward slowly, wrong calibration": Manoeuvre(
        kind="levers", speed_kmh=22.4, payload_kg=2850, arm_deg=20.3, angle_deg=13.4, rate_deg_s=20.7, seed=1881059069,
        calibration_seed=1956545167, lift_percent=-100.0, tilt_percent=-100.0, ramp_s=0.5, held_s=1.95,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", DRIVES)
def test_no_wheel_lifts_when_levers_are_let_go(name):
    judged, recording = driven(DRIVES[name], limits=True)
    assert not judged.lifted
    begin, end = recording.truth[0], recording.truth[-1]
    assert end.lift_arm_angle < begin.lift_arm_angle - 0.03, "the arm comes down all the same"
