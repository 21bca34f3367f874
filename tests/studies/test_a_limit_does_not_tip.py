"""A speed limit that brakes on a slope: it took from the outer front wheel what was left on it (ADR 85)."""

import pytest

from studies.campaigns.manoeuvres import Manoeuvre
from studies.campaigns.prevention import driven

SLOW_AND_HIGH = Manoeuvre(
    kind="slope",
    speed_kmh=7.9,
    payload_kg=3204,
    arm_deg=31.2,
    angle_deg=-34.4,
    rate_deg_s=21.7,
    seed=1675620720,
    calibration_seed=648671676,
    grade_percent=15.9,
    bank_deg=8.4,
)
QUICK = Manoeuvre(
    kind="slope",
    speed_kmh=18.4,
    payload_kg=3204,
    arm_deg=17.0,
    angle_deg=32.6,
    rate_deg_s=15.4,
    seed=2064141523,
    calibration_seed=1099379606,
    grade_percent=16.2,
    bank_deg=7.7,
)


@pytest.mark.parametrize("drive", [SLOW_AND_HIGH, QUICK])
def test_braking_for_a_limit_lifts_no_wheel_on_a_slope(drive):
    judged, recording = driven(drive, limits=True)
    assert not judged.lifted
    assert min(min(row.normal_force) for row in recording.truth) > 0.0
