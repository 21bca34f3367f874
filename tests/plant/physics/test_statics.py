"""Wheel loads at rest, tipping loads and the tilt table, against figures and methods that are not the plant's."""

import math

import numpy as np
import pytest

from plant.physics.equilibrium import NoEquilibriumError
from plant.physics.surface import Surface
from plant.plant import Commands, Plant
from plant.sheets.machine import load_machine
from studies.standards.rest import lift_off_slope, rigid, tipping_load
from tests.plant.oracle import statics

MACHINE = load_machine("l60")
FULL = math.radians(40.0)
TOP = math.radians(46.0)
G = 9.81

# machine sheet 1.4: payload, articulation, arm; FL, FR, each rear wheel [kN]. Rigid three-point statics.
TABLE = [
    (0.0, 0.0, None, 27.0, 27.0, 31.1),
    (3204.0, 0.0, None, 52.1, 52.1, 21.7),
    (0.0, FULL, None, 25.9, 27.9, 31.2),
    (3204.0, FULL, None, 62.8, 43.6, 20.6),
    (3204.0, 0.0, 0.0, 55.6, 55.6, 18.2),
    (3204.0, 0.0, TOP, 50.0, 50.0, 23.8),
]


def pose(payload, delta, lift):
    return {"payload_mass": payload, "articulation_angle": delta, "lift_arm_angle": lift}


@pytest.mark.parametrize(("payload", "delta", "lift", "left", "right", "rear"), TABLE)
def test_wheel_loads_on_hard_tyres_are_those_of_three_point_statics(payload, delta, lift, left, right, rear):
    """On hard tyres the plant's loads are the table's. Tolerance 0.1 kN: the table gives one decimal."""
    loads = Plant(rigid(MACHINE), **pose(payload, delta, lift)).truth().normal_force / 1e3
    np.testing.assert_allclose(loads, (left, right, rear, rear), rtol=0, atol=0.1)


@pytest.mark.parametrize(("payload", "delta", "lift", "left", "right", "rear"), TABLE)
def test_soft_tyres_change_the_wheel_loads_by_pitch_and_roll_only(payload, delta, lift, left, right, rear):
    """Real tyres let the machine lean: up to 2 % of a load, 1.2 kN laden at full articulation, never more."""
    loads = Plant(MACHINE, **pose(payload, delta, lift)).truth().normal_force / 1e3
    np.testing.assert_allclose(loads, (left, right, rear, rear), rtol=0.02, atol=0)


@pytest.mark.parametrize("name", ["l60", "compact"])
@pytest.mark.parametrize(
    ("load", "turn", "lift"), [(0, 0, None), (0, 1, None), (1, 1, None), (1, 0, 0.0), (1, -1, TOP)]
)
def test_rest_is_the_minimum_of_potential_energy(name, load, turn, lift):
    """Energy of all bodies and springs, minimised without any force balance. 2e-6: what the minimiser reaches.

    load: of the machine's rated payload; turn: of its largest articulation.
    """
    machine = load_machine(name)
    payload, delta = load * machine.payload.reference_mass, turn * machine.steering.limit
    truth = Plant(machine, **pose(payload, delta, lift)).truth()
    expected = statics.resting_loads(machine, payload, delta, truth.lift_arm_angle, truth.tilt_angle)
    np.testing.assert_allclose(truth.normal_force, expected, rtol=2e-6)


@pytest.mark.parametrize(("delta_deg", "expected"), [(0, 8080.0), (35, 7347.0), (40, 7132.0)])
def test_tipping_loads_on_hard_tyres(delta_deg, expected):
    """machine sheet 1.5. 0.2 %: its table rounds the CoG to a millimetre, worth 0.1 %; ours adds 0.1 mm of tyre."""
    assert tipping_load(rigid(MACHINE), math.radians(delta_deg)) == pytest.approx(expected, rel=2e-3)


def test_full_turn_tipping_load_meets_the_rated_payload():
    """ISO 14397-1 by the bench: rated load is half the tipping load, so 3204 kg needs 6408 kg; ratios of the class."""
    hard, soft = rigid(MACHINE), MACHINE
    straight, full = tipping_load(hard, 0.0), tipping_load(hard, FULL)
    soft_full = tipping_load(soft, FULL)
    assert 0.86 <= full / straight <= 0.90
    assert soft_full >= 6408.0
    assert 0.05 <= 1.0 - soft_full / full <= 0.10


def test_straight_tipping_load_on_linear_tyres_by_hand():
    """All bodies turn about the front wheels' hubs (the contact stays below them) as the front tyres give way.

    The figure of 7478 kg in machine sheet 1.5 turns them about the ground contact instead, which moves
    the centre of gravity by the tyre's radius too much.
    """
    machine = statics.linear_tyre(MACHINE)
    g = machine.geometry

    def overturning(load):
        """Moment about the front contact, by hand; positive tips forward."""
        front = (machine.mass + load) * G / 2 / 750e3
        pitch = math.asin(front / (g.front_axle_x - g.rear_axle_x))
        c, s = math.cos(pitch), math.sin(pitch)
        return sum(
            m * ((p[0] - g.front_axle_x) * c + (p[2] - g.wheel_centre_height) * s)
            for m, p, _, _ in statics.bodies(machine, load, 0.0, 0.0, machine.tilt.carry_angle, 0.0)
        )

    low, high = 5000.0, 9000.0
    while high - low > 0.1:
        middle = (low + high) / 2
        low, high = (low, middle) if overturning(middle) > 0 else (middle, high)
    # 0.1 %: a secant over the last 2 % of the way to a nearly linear zero
    assert tipping_load(machine, 0.0) == pytest.approx(low, rel=1e-3)


# machine sheet 4: payload, articulation, arm, side of the rear frame that is uphill, a_y/g at lift-off.
THRESHOLDS = [
    (0.0, 0.0, None, 1, 0.66),
    (0.0, FULL, None, 1, 0.57),
    (0.0, FULL, None, -1, 0.76),
    (3204.0, 0.0, None, 1, 0.83),
    (3204.0, FULL, None, 1, 0.94),
    (3204.0, FULL, None, -1, 0.76),
    (3204.0, 0.0, TOP, 1, 0.37),
    (3204.0, FULL, TOP, 1, 0.37),
    (3204.0, FULL, TOP, -1, 0.39),
]


@pytest.mark.parametrize(("payload", "delta", "lift", "side", "expected"), THRESHOLDS)
def test_roll_over_thresholds_on_a_tilt_table(payload, delta, lift, side, expected):
    """Hard tyres, brakes on, against the sheet's figures.

    4.5 %: articulated, the figure hangs on the pivot's share of the side force, 0.03 for each 0.05
    of share by the closed form below. The sheet does not state its share (0.76 inside, empty, needs
    0.30); the braked machine's is 0.37, since wheels also hold by longitudinal force: 0.79. Straight
    figures agree to their last digit. What pins the plant is the closed form at its own share, next test.
    """
    machine = statics.with_tyre(
        rigid(MACHINE),
        pdx1=3.0,
        pdx2=0.0,
        pdy1=3.0,
        pdy2=0.0,
        longitudinal_stiffness=1e8,
        lateral_stiffness=1e8,
    )
    assert lift_off_slope(machine, delta, payload, lift, side) == pytest.approx(expected, rel=0.045)


@pytest.mark.parametrize("bank", [-0.2, 0.1, 0.3])
@pytest.mark.parametrize("delta", [-0.5, 0.0, 0.3])
def test_banked_wheel_loads_agree_with_the_closed_form(delta, bank):
    """docs/explanation/estimators.md, with the side force at the pivot taken from the tyres. 0.1 %: hard tyres lean by 1e-4 rad."""
    machine = rigid(MACHINE)
    truth = Plant(machine, Surface(friction=2.0, bank=bank), articulation_angle=delta).truth()
    parts = statics.bodies(machine, 0.0, delta, truth.lift_arm_angle, truth.tilt_angle, 0.0)
    g, l_f, l_r, t = (
        machine.geometry,
        machine.geometry.front_axle_x,
        -machine.geometry.rear_axle_x,
        MACHINE.geometry.track,
    )
    axle = machine.rear_axle.mass + 2 * machine.wheel.mass
    body = [(part, c) for (part, c, _, _) in parts[:-5]] + [(m, c) for (m, c, _, _) in parts[-4:-2]]
    m = sum(part for part, _ in body)
    x, y, h = sum(part * c for part, c in body) / m
    f_x, f_y, f_z = truth.cog_specific_force
    assert f_x == pytest.approx(0.0, abs=1e-3)
    side_at_pivot = float(truth.lateral_force[2:].sum()) - axle * f_y
    share, h_r, h_a = side_at_pivot / (m * f_y), machine.oscillation.pivot_height, g.wheel_centre_height
    x_, y_ = x - (h + axle / m * h_a) * f_x / f_z, y - (h - share * h_r) * f_y / f_z
    c, s, d = math.cos(delta), math.sin(delta), t * (l_f + l_r * math.cos(delta))
    n1 = m * f_z * ((x_ + l_r) * (t / 2 * c - l_f * s) + (l_f * c + l_r + t / 2 * s) * y_) / d
    n2 = m * f_z * ((x_ + l_r) * (t / 2 * c + l_f * s) - (l_f * c + l_r - t / 2 * s) * y_) / d
    n_r = m * f_z - n1 - n2
    tilt = (share * m * h_r + axle * h_a) * f_y / t
    expected = (n1, n2, (n_r + axle * f_z) / 2 - tilt, (n_r + axle * f_z) / 2 + tilt)
    np.testing.assert_allclose(truth.normal_force, expected, rtol=0, atol=1e-3 * 30e3)


@pytest.mark.parametrize(
    "surface",
    [
        Surface(),
        Surface(grade=math.atan(0.3)),
        Surface(friction=0.9, grade=-math.radians(30.0)),
        Surface(bank=0.2),
    ],
)
@pytest.mark.parametrize("delta", [0.0, 0.5])
def test_a_braked_machine_stays_where_it_stands(surface, delta):
    """No creep through brakes or tyres in a minute: less than 1 mm asked; what is left is rounding."""
    plant = Plant(MACHINE, surface, articulation_angle=delta)
    before = plant.truth()
    plant.advance(Commands(brake_torque=(20e3,) * 4), 60.0)
    after = plant.truth()
    assert np.linalg.norm(after.position - before.position) < 1e-6
    np.testing.assert_allclose(after.normal_force, before.normal_force, rtol=1e-6)
    np.testing.assert_array_equal(after.wheel_speed, np.zeros(4))


@pytest.mark.parametrize("grade", [0.0, 0.25, -0.25])
@pytest.mark.parametrize("bank", [0.0, 0.15])
def test_rest_balances_weight(grade, bank):
    """Sum of tyre forces is minus the weight: the accelerometer at the CoG reads 9.81 m/s2, straight up."""
    truth = Plant(MACHINE, Surface(grade=grade, bank=bank), heading=0.7).truth()
    up = np.array((-math.sin(truth.pitch), math.cos(truth.pitch) * math.sin(truth.roll), 0.0))
    up[2] = math.cos(truth.pitch) * math.cos(truth.roll)
    np.testing.assert_allclose(truth.cog_specific_force, G * up, rtol=0, atol=1e-8)
    np.testing.assert_allclose(truth.acceleration, 0.0, atol=1e-8)


def test_grade_is_uphill_and_bank_is_left_side_up():
    uphill, banked = Plant(MACHINE, Surface(grade=0.2)).truth(), Plant(MACHINE, Surface(bank=0.2)).truth()
    assert uphill.pitch < -0.19, "uphill is nose up, pitch is nose down"
    assert uphill.normal_force[2:].sum() > 1.1 * Plant(MACHINE).truth().normal_force[2:].sum()
    assert banked.roll > 0.19
    assert banked.load_transfer_ratio > 0.1, "the right side is the lower one"


def test_no_rest_is_an_error_that_says_why():
    with pytest.raises(NoEquilibriumError, match="friction"):
        Plant(MACHINE, Surface(friction=0.2, grade=math.radians(30.0)))
    with pytest.raises(NoEquilibriumError, match="tip over"):
        Plant(MACHINE, payload_mass=9000.0, lift_arm_angle=0.0)
