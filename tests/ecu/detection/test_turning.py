"""The yaw rate that speed and articulation give, where the tyres slip sideways to turn the machine."""

import math

import pytest

from ecu.calibration import load_calibration
from ecu.detection.machine import turning_shares
from ecu.estimators.loads.cog import front_unit, machine_centre
from ecu.estimators.stability.rollover import loaded_machine
from studies.campaigns.manoeuvres import Manoeuvre
from studies.campaigns.prevention import called_faulty, driven

P = load_calibration().parameters
POSE = -math.acos(0.8)
"""The arm's angle that the detection reckons with."""


@pytest.mark.parametrize("payload", [0.0, 1600.0, 3204.0])
def test_axles_turn_the_machine_as_a_couple(payload):
    """Two lumps turned together by two equal and opposite side forces, each over the load that its axle carries."""
    m = loaded_machine(front_unit(POSE, P.bucket.carried, payload, P.front, P.arm, P.bucket), payload, P)
    front, rear = m.front, m.rear_unit
    centre = machine_centre(0.0, front, rear)
    inertia = sum(b.yaw_inertia + b.mass * (b.x - centre.x) ** 2 for b in (front, rear))
    g = P.geometry
    side_force = inertia * 1.0 / (g.front_length + g.rear_length)
    loads = m.standing
    expected = (
        side_force / (loads.front_left + loads.front_right),
        side_force / (loads.rear_left + loads.rear_right),
    )
    assert turning_shares(payload, P) == pytest.approx(expected, rel=0.03)


def test_the_lighter_axle_uses_more_of_its_grip():
    front, rear = turning_shares(3204.0, P)
    assert rear > 2.0 * front


SLIPPERY_COUNTER_STEER = Manoeuvre(
    kind="counter-steer",
    speed_kmh=13.2,
    payload_kg=3204,
    arm_deg=-11.3,
    angle_deg=22.5,
    rate_deg_s=22.0,
    seed=1004405807,
    friction=0.44,
)
AFTER_A_KERB = Manoeuvre(
    kind="kerb",
    speed_kmh=14.0,
    payload_kg=3204,
    arm_deg=12.8,
    angle_deg=-37.9,
    rate_deg_s=26.0,
    seed=1763415924,
    right_m=0.078,
    friction=0.47,
)


@pytest.mark.parametrize("drive", [SLIPPERY_COUNTER_STEER, AFTER_A_KERB])
def test_a_light_rear_axle_that_slides_is_no_fault_of_the_gyro(drive):
    _, recording = driven(drive, limits=True)
    assert called_faulty(recording) == []
