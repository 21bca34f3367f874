"""Sharp turns in reverse at the limit of the tyres: sound sensors are not called faulty.

The axles slip sideways there, and a turned front axle's wheels take that for speed: the rolling machine's speed, and with it what the slope
sensor is corrected by, is wrong by up to half a metre per second.
"""

import pytest

from studies.campaigns.manoeuvres import Manoeuvre
from studies.campaigns.prevention import called_faulty, driven


def turn(speed_kmh, angle_deg, friction, *, rate_deg_s=24.0, arm_deg=0.0, calibration_seed=None):
    """A loaded machine on even ground, its joint turned as far as it goes."""
    return Manoeuvre(
        "reverse", speed_kmh, 3204, arm_deg, angle_deg, rate_deg_s, 7, calibration_seed,
        lift_percent=0.0, tilt_percent=0.0, ramp_s=0.01, held_s=0.0, left_m=0.0, right_m=0.0,
        grade_percent=0.0, bank_deg=0.0, friction=friction,
    )  # fmt: skip


TURNS = [
    turn(-18.0, -36.7, 0.53, arm_deg=5.7),
    turn(-18.0, -34.0, 0.42, rate_deg_s=18.8, arm_deg=-14.6),
    turn(-18.0, 36.6, 0.43, arm_deg=-27.5, calibration_seed=1752475003),
    turn(18.0, -34.0, 0.42, rate_deg_s=18.8, arm_deg=-14.6),
]


@pytest.mark.parametrize("manoeuvre", TURNS)
def test_no_sensor_is_called_faulty(manoeuvre):
    assert called_faulty(driven(manoeuvre, limits=True)[1]) == []
