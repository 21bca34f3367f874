"""Cylinder geometry and pressures: tables of machine sheet 1.6, virtual work, potential energy."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from plant.physics import state as s
from plant.physics.linkage import LINKAGE, lift_cylinder, linkage_of, pressures, tilt_cylinder
from plant.plant import Commands, Plant
from plant.sheets.machine import load_machine

MACHINE = load_machine("l60")
LIFT, TILT = MACHINE.lift, MACHINE.tilt
K = linkage_of(LIFT, TILT)
POSES = [(-0.8, 0.0), (-0.65, 0.82), (0.0, 0.82), (0.0, -0.3), (0.4, 0.5), (0.8, -0.8), (0.8, 0.87)]
G = 9.81


@pytest.mark.parametrize(
    ("angle_deg", "arm"), [(-46, 0.342), (-37, 0.411), (-23, 0.477), (0, 0.500), (23, 0.450), (46, 0.354)]
)
def test_moment_arm(angle_deg, arm):
    """machine sheet 1.6, three digits."""
    assert lift_cylinder(K, math.radians(angle_deg))[1] == pytest.approx(arm, abs=1e-3)


def test_stroke():
    """0.990 m to 1.713 m between the pins; three digits."""
    assert lift_cylinder(K, LIFT.lower_limit)[0] == pytest.approx(0.990, abs=1e-3)
    assert lift_cylinder(K, LIFT.upper_limit)[0] == pytest.approx(1.713, abs=1e-3)


@pytest.mark.parametrize("angle", [-0.8, -0.3, 0.0, 0.4, 0.8])
def test_moment_arm_is_the_derivative_of_the_length(angle):
    """Virtual work. Central difference over 2e-6 rad: 1e-9 m."""
    h = 1e-6
    slope = (lift_cylinder(K, angle + h)[0] - lift_cylinder(K, angle - h)[0]) / (2 * h)
    assert lift_cylinder(K, angle)[1] == pytest.approx(slope, abs=1e-8)


def turned(point, angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array((point[0] * c - point[1] * s, point[0] * s + point[1] * c))


def lengths_by_closing_the_loop(machine, arm, tilt):
    """Lengths of lift and tilt cylinder from the machine file: the crank turns until the link fits."""
    lift, t = machine.lift, machine.tilt
    pivot = np.array((lift.pivot_x, lift.pivot_z))
    crank = pivot + turned((t.crank_along, t.crank_above), arm)
    bucket = pivot + turned((lift.arm_length, 0.0), arm)
    bucket = bucket + turned((t.bucket_pin_x, t.bucket_pin_z), tilt - t.carry_angle)
    ahead = math.atan2(*(bucket - crank)[::-1])

    def gap(angle):
        end = crank + turned((t.crank_link_arm, 0.0), angle)
        return np.linalg.norm(end - bucket) - t.link_length

    at = brentq(gap, ahead - math.pi, ahead, xtol=1e-15, rtol=1e-14)
    upper = crank + turned((t.crank_cylinder_arm, 0.0), at + t.crank_angle)
    rod = pivot + turned((lift.rod_pin_along, lift.rod_pin_above), arm)
    return np.array(
        (
            np.linalg.norm(rod - (lift.base_x, lift.base_z)),
            np.linalg.norm(upper - (t.base_x, t.base_z)),
        )
    )


@pytest.mark.parametrize("name", ["l60", "compact"])
@pytest.mark.parametrize(("arm", "tilt"), POSES)
def test_moment_arms_of_the_tilt_cylinder_by_virtual_work(name, arm, tilt):
    """Pin equilibrium gives the derivative of the length: over 2e-5 rad, the loop closed to 1e-14, 1e-8 m."""
    machine, h = load_machine(name), 1e-5
    length, on_bucket, on_arm = tilt_cylinder(linkage_of(machine.lift, machine.tilt), arm, tilt)

    def at(a, b):
        return lengths_by_closing_the_loop(machine, a, b)[1]

    assert length == pytest.approx(at(arm, tilt), abs=1e-12)
    assert on_bucket == pytest.approx((at(arm, tilt + h) - at(arm, tilt - h)) / (2 * h), abs=1e-8)
    assert on_arm == pytest.approx((at(arm + h, tilt + h) - at(arm - h, tilt - h)) / (2 * h), abs=1e-8)


@pytest.mark.parametrize("name", ["l60", "compact"])
def test_the_linkage_moves_over_the_whole_range(name):
    """No dead point within the limits: the tilt cylinder's moment arm on the bucket stays above a third of its most."""
    machine = load_machine(name)
    k = linkage_of(machine.lift, machine.tilt)
    arms = [
        tilt_cylinder(k, a, b)[1]
        for a in np.linspace(machine.lift.lower_limit, machine.lift.upper_limit, 25)
        for b in np.linspace(machine.tilt.lower_limit, machine.tilt.upper_limit, 25)
    ]
    assert min(arms) > max(arms) / 3


@pytest.mark.parametrize("name", ["l60", "compact"])
@pytest.mark.parametrize(("arm", "tilt"), POSES)
def test_pressures_at_rest_are_the_slope_of_potential_energy_over_length(name, arm, tilt):
    """Lift and tilt forces F with F . dL = dU for every motion of arm and bucket, U of the weights in the machine's lean.

    Both sides by differences over 2e-5 rad, lengths by closing the loop: 1e-6.
    """
    machine = load_machine(name)
    load = machine.payload.reference_mass
    truth = Plant(machine, payload_mass=load, lift_arm_angle=arm, tilt_angle=tilt).truth()
    lift, t, h = machine.lift, machine.tilt, 1e-5

    def energy(a, b):
        pin = turned((lift.arm_length, 0.0), a)
        points = (
            (machine.lift_arm, turned((machine.lift_arm.x, machine.lift_arm.z), a), machine.lift_arm.mass),
            (
                machine.bucket,
                pin + turned((machine.bucket.x, machine.bucket.z), b - t.carry_angle),
                machine.bucket.mass,
            ),
            (machine.payload, pin + turned((machine.payload.x, machine.payload.z), b - t.carry_angle), load),
        )
        lean = -truth.pitch
        return sum(m * G * turned(place, lean)[1] for _, place, m in points)

    steps = [(h, 0.0), (0.0, h)]
    lengths = np.array(
        [
            lengths_by_closing_the_loop(machine, arm + da, tilt + db)
            - lengths_by_closing_the_loop(machine, arm - da, tilt - db)
            for da, db in steps
        ]
    )
    rise = np.array([energy(arm + da, tilt + db) - energy(arm - da, tilt - db) for da, db in steps])
    force = np.linalg.solve(lengths, rise)
    head = np.array([part.cylinder_count * math.pi / 4 * part.bore**2 for part in (lift, t)])
    rod = head - [part.cylinder_count * math.pi / 4 * part.rod**2 for part in (lift, t)]
    expected = np.maximum((force + 0.5e6 * rod) / head, 0.0)
    np.testing.assert_allclose((truth.lift_pressure, truth.tilt_pressure), expected, rtol=1e-6)


@pytest.mark.parametrize("angle_deg", [-37, -20, 0, 20, 46])
@pytest.mark.parametrize(("payload", "low", "high"), [(0.0, 2.0e6, 5.0e6), (3204.0, 8.0e6, 16.0e6)])
def test_lift_pressure_at_rest(angle_deg, payload, low, high):
    """Ranges of machine sheet 1.6: 3 to 5 MPa empty, 11 to 16 MPa with 3204 kg; the tilt cylinder carries a part of it."""
    truth = Plant(MACHINE, payload_mass=payload, lift_arm_angle=math.radians(angle_deg)).truth()
    assert low <= truth.lift_pressure <= high


def test_pressures_do_not_turn_negative():
    assert pressures(K, 0.0, 0.8, -1e6, 0.0)[0] == 0.0
    assert pressures(K, 0.0, 0.8, 0.0, -1e6)[1] == 0.0
    assert len(K) == LINKAGE


def test_raising_the_arm_takes_more_pressure_while_it_accelerates():
    """Sign of the inertia: speeding up upwards, the pressure exceeds the one at rest."""
    plant = Plant(MACHINE, payload_mass=3204.0)
    at_rest = plant.truth().lift_pressure
    plant.advance(Commands(brake_torque=(2e4,) * 4, lift_rate=0.2), 0.02)
    assert plant.truth().lift_pressure > 1.1 * at_rest


def test_the_cylinders_do_the_work_of_the_joints():
    """Power of both cylinders, pressure times area times speed, is that of the joints' torques: 1e-6."""
    plant = Plant(MACHINE, payload_mass=3204.0, lift_arm_angle=-0.3, tilt_angle=0.6)
    plant.advance(Commands(brake_torque=(2e4,) * 4, lift_rate=0.2, tilt_rate=0.1), 0.5)
    truth, effort = plant.truth(), plant._work.tree.effort
    lift_rate, tilt_rate, h = truth.lift_arm_rate, truth.tilt_rate, 1e-6
    before, after = (
        lengths_by_closing_the_loop(
            MACHINE, truth.lift_arm_angle + way * lift_rate, truth.tilt_angle + way * tilt_rate
        )
        for way in (-h, h)
    )
    head = np.array([part.cylinder_count * math.pi / 4 * part.bore**2 for part in (LIFT, TILT)])
    rod = head - [part.cylinder_count * math.pi / 4 * part.rod**2 for part in (LIFT, TILT)]
    force = np.array((truth.lift_pressure, truth.tilt_pressure)) * head - 0.5e6 * rod
    joints = effort[s.LIFT_ARM] * lift_rate + effort[s.BUCKET] * (tilt_rate - lift_rate)
    assert force @ (after - before) / (2 * h) == pytest.approx(joints, rel=1e-6)
