"""A limit that comes back within half a period of the machine's rocking lets the driver push on in every good half.

Drives in which a wheel lifted because of that (ADR 83).
"""

import dataclasses
import math

import pytest

from ecu.calibration import load_calibration
from ecu.estimators.loads.cog import front_unit
from ecu.estimators.stability.rollover import loaded_machine
from studies.campaigns.manoeuvres import Manoeuvre, straight
from studies.campaigns.prevention import beside, lift_offs


@pytest.mark.parametrize("name", ["l60", "compact"])
def test_a_limit_takes_two_periods_of_rocking_to_come_back(name):
    """Of the slowest pitching: with the rated payload, 3.2 times the one that is called high, and the arm up."""
    calibration = load_calibration(name)
    p, payload = calibration.parameters, 3.2 * calibration.warnings.payload
    front = front_unit(math.radians(45.0), math.radians(45.0), payload, p.front, p.arm, p.bucket)
    period = 2.0 * math.pi / loaded_machine(front, payload, p).pitch_frequency
    joint = math.radians(27.0)  # as fast as drivers of the campaign on prevention turn
    assert joint / calibration.limits.rate_rise >= 2.0 * period
    assert p.linkage_drive.lift_down / calibration.limits.linkage_rise >= 2.0 * period


LEVERS = Manoeuvre(
    "levers", 8.5, 3204, -28.6, 24.1, 16.1, 5,
    lift_percent=-100.0, tilt_percent=-100.0, held_s=0.99, friction=0.75,
)  # fmt: skip
RELEASED = [
    LEVERS,
    dataclasses.replace(
        LEVERS, speed_kmh=7.4, arm_deg=37.1, angle_deg=-14.6, rate_deg_s=26.8, ramp_s=0.2, held_s=1.51
    ),
    dataclasses.replace(
        LEVERS, speed_kmh=13.8, arm_deg=3.0, angle_deg=-35.5, rate_deg_s=21.3, tilt_percent=0.0, held_s=0.83
    ),
]


@pytest.mark.parametrize("manoeuvre", RELEASED)
def test_a_full_bucket_lowered_in_a_turn_and_let_go_keeps_every_wheel_down(manoeuvre):
    assert lift_offs(manoeuvre) == []


THROWN = {
    "17 cm at 14 km/h": Manoeuvre("kerb", 14.0, 2911, 16.2, -32.4, 24.1, 892397983, left_m=0.172),
    "18 cm at 12 km/h": Manoeuvre("kerb", 11.9, 3204, 43.9, -21.4, 19.7, 1400968303, left_m=0.182, friction=0.69),
    "14 cm, empty": Manoeuvre("kerb", 14.0, 0, 31.3, -16.4, 21.0, 1443680023, left_m=0.142, friction=0.71),
    "19 cm, arm low": Manoeuvre("kerb", 8.8, 2700, -35.8, 19.5, 15.5, 2137079804, left_m=0.186, friction=0.67),
    "18 cm to the left": Manoeuvre("kerb", 14.0, 2777, 30.8, 22.2, 15.3, 708767040, right_m=0.179),
}  # fmt: skip


@pytest.mark.parametrize("kerb", THROWN.values(), ids=list(THROWN))
def test_a_turn_after_a_kerb_lifts_no_wheel_that_the_kerb_does_not(kerb):
    """The rear rocks for two seconds after a kerb, and lifts by itself in the first; the turn begins meanwhile.

    The first needs the slow rise of a limit (ADR 83), the others that the turn is not taken for what rocks the machine (ADR 89).
    """
    by_ground = lift_offs(straight(kerb), least_s=0.0)
    assert by_ground
    assert [lifted for lifted in lift_offs(kerb) if not beside(lifted, by_ground)] == []
