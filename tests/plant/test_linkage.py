"""Cylinder geometry and pressures against the tables of machine sheet 1.6."""

import math

import pytest

from plant.linkage import lift_cylinder, lift_pressure, tilt_pressure
from plant.machine import load_machine
from plant.plant import Commands, Plant

MACHINE = load_machine("l60")
LIFT, TILT = MACHINE.lift, MACHINE.tilt


@pytest.mark.parametrize(
    ("angle_deg", "arm"), [(-46, 0.342), (-37, 0.411), (-23, 0.477), (0, 0.500), (23, 0.450), (46, 0.354)]
)
def test_moment_arm(angle_deg, arm):
    """machine sheet 1.6, three digits."""
    assert lift_cylinder(LIFT, math.radians(angle_deg))[1] == pytest.approx(arm, abs=1e-3)


def test_stroke():
    """0.990 m to 1.713 m between the pins; three digits."""
    assert lift_cylinder(LIFT, LIFT.lower_limit)[0] == pytest.approx(0.990, abs=1e-3)
    assert lift_cylinder(LIFT, LIFT.upper_limit)[0] == pytest.approx(1.713, abs=1e-3)


@pytest.mark.parametrize("angle", [-0.8, -0.3, 0.0, 0.4, 0.8])
def test_moment_arm_is_the_derivative_of_the_length(angle):
    """Virtual work. Central difference over 2e-6 rad: 1e-9 m."""
    h = 1e-6
    slope = (lift_cylinder(LIFT, angle + h)[0] - lift_cylinder(LIFT, angle - h)[0]) / (2 * h)
    assert lift_cylinder(LIFT, angle)[1] == pytest.approx(slope, abs=1e-8)


@pytest.mark.parametrize("angle_deg", [-37, -20, 0, 20, 46])
@pytest.mark.parametrize(("payload", "low", "high"), [(0.0, 3.0e6, 5.0e6), (3204.0, 13.0e6, 14.4e6)])
def test_lift_pressure_at_rest(angle_deg, payload, low, high):
    """machine sheet 1.6: 3 to 5 MPa empty, 13.0 to 14.4 MPa with 3204 kg over the whole arc."""
    truth = Plant(MACHINE, payload_mass=payload, lift_arm_angle=math.radians(angle_deg)).truth()
    assert low <= truth.lift_pressure <= high


def test_payload_raises_the_lift_pressure_by_its_moment():
    """3.0 kPa per kg, arm level: 9.81 x 2.88 m / (0.500 m x 190.1 cm2) = 2.97 kPa/kg; lean of the machine 0.2 %."""
    light, heavy = (
        Plant(MACHINE, payload_mass=m, lift_arm_angle=0.0).truth().lift_pressure for m in (1000.0, 2000.0)
    )
    area = 2 * math.pi / 4 * 0.110**2
    by_hand = 9.81 * (2.43 + 0.45) / (lift_cylinder(LIFT, 0.0)[1] * area)
    assert (heavy - light) / 1000.0 == pytest.approx(by_hand, rel=5e-3)
    assert 2600.0 <= (heavy - light) / 1000.0 <= 3400.0


def test_tilt_pressure_by_hand():
    """Bucket and payload on a constant moment arm, against the rod-side back pressure."""
    torque = 9.81 * (880.0 * 0.42 + 3204.0 * 0.45)
    arm = 0.43 / math.radians(98.0)
    head, rod = math.pi / 4 * 0.150**2, math.pi / 4 * (0.150**2 - 0.080**2)
    by_hand = (torque / arm + 0.5e6 * rod) / head
    assert tilt_pressure(TILT, torque) == pytest.approx(by_hand, rel=1e-12)
    assert Plant(MACHINE, payload_mass=3204.0).truth().tilt_pressure == pytest.approx(
        by_hand, rel=0.02
    )  # lean 1 deg


def test_pressures_do_not_turn_negative():
    assert lift_pressure(LIFT, 0.0, -1e6) == 0.0
    assert tilt_pressure(TILT, -1e6) == 0.0


def test_raising_the_arm_takes_more_pressure_while_it_accelerates():
    """Sign of the inertia: speeding up upwards, the pressure exceeds the one at rest."""
    plant = Plant(MACHINE, payload_mass=3204.0)
    at_rest = plant.truth().lift_pressure
    plant.advance(Commands(brake_torque=(2e4,) * 4, lift_rate=0.2), 0.02)
    assert plant.truth().lift_pressure > 1.1 * at_rest
