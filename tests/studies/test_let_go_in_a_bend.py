"""Levers let go in a sharp turn: a prediction whose axles rocked as those of a straight machine do permitted what lifted the rear (ADR 84)."""

import pytest

from studies.campaigns.manoeuvres import Manoeuvre
from studies.campaigns.prevention import driven

LOWERED_AND_DUMPED = Manoeuvre(
    kind="levers",
    speed_kmh=8.2,
    payload_kg=3204,
    arm_deg=19.5,
    angle_deg=34.1,
    rate_deg_s=25.4,
    seed=74062669,
    lift_percent=-100.0,
    tilt_percent=-100.0,
    held_s=1.66,
)
LOWERED = Manoeuvre(
    kind="levers",
    speed_kmh=11.5,
    payload_kg=3204,
    arm_deg=1.1,
    angle_deg=36.4,
    rate_deg_s=26.8,
    seed=982380802,
    calibration_seed=903263906,
    lift_percent=-100.0,
    held_s=0.31,
)


@pytest.mark.parametrize("drive", [LOWERED_AND_DUMPED, LOWERED])
def test_a_full_bucket_let_go_in_a_bend_lifts_no_wheel(drive):
    judged, recording = driven(drive, limits=True)
    assert not judged.lifted
    assert min(min(row.normal_force) for row in recording.truth) > 0.0
