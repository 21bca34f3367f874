"""Tyres: each effect against the law that its equation states."""

import math
import sys

import numpy as np
import pytest

from plant.effects.curves import between_knots
from plant.physics import state as s
from plant.physics.parameters import P_WHEELS, W_DAMPING, W_RADIUS, WHEEL_SIZE, parameter_vector
from plant.physics.state import T_KAPPA_RATE, T_OUTPUTS, T_TAN_ALPHA_RATE
from plant.physics.surface import Surface
from plant.physics.tyre import combined_forces, radial_force, stiffness_and_peak, tyre_forces
from plant.plant import Commands, Plant
from tests.plant.effects.trial import (
    L60,
    coast,
    evaluated,
    machine,
    run,
    strong,
    wrenches,
)

LOAD = 29e3


def front(given):
    """The block of the front left wheel."""
    return parameter_vector(given, Surface(), 0.0)[P_WHEELS : P_WHEELS + WHEEL_SIZE]


def relaxation(given, which, speed):
    """Way [m] over which a small transient slip decays at a speed."""
    out = np.zeros(T_OUTPUTS)
    slip = 1e-4
    slips = (slip, 0.0) if which == T_KAPPA_RATE else (0.0, slip)
    tyre_forces(front(given), 1.0, LOAD, speed, 0.0, 0.0, *slips, 0.0, out)
    return -speed * slip / out[which]


@pytest.mark.parametrize(
    ("name", "which"), [("longitudinal_relaxation", T_KAPPA_RATE), ("lateral_relaxation", T_TAN_ALPHA_RATE)]
)
def test_a_relaxation_length_is_a_way_and_scales(name, which):
    lengths = [relaxation(machine(name, factor=2.5), which, speed) for speed in (1.0, 3.0, 9.0)]
    assert lengths == pytest.approx([2.5 * relaxation(L60, which, 1.0)] * 3, rel=1e-6)
    other = T_TAN_ALPHA_RATE if which == T_KAPPA_RATE else T_KAPPA_RATE
    assert relaxation(machine(name, factor=2.5), other, 3.0) == pytest.approx(relaxation(L60, other, 3.0))


def test_without_combined_slip_the_forces_do_not_mix():
    def along(given, kappa, tan_alpha):
        w = front(given)
        return combined_forces(w, LOAD, stiffness_and_peak(w, 1.0, LOAD), kappa, tan_alpha)[0]

    apart = machine("combined_slip", factor=0.0)
    assert along(apart, 0.05, 0.2) == pytest.approx(along(L60, 0.05, 0.0), rel=1e-12)
    assert along(L60, 0.05, 0.2) < 0.95 * along(L60, 0.05, 0.0)


def test_camber_thrust_pushes_to_the_side_of_the_lean():
    """Standing on a step under the left wheels: the tops lean to the right."""
    from dataclasses import replace

    from plant.effects import find_effect

    step = find_effect("kerb").of(distance_m=-100.0, length_m=1.0, left_m=0.05, right_m=0.0)
    plain = Plant(replace(L60, effects=(step,)), speed=2.0)
    thrust = replace(L60, effects=(step, find_effect("camber_thrust").of(coefficient=0.5)))
    difference = wrenches(evaluated(plain, thrust)) - wrenches(evaluated(plain))
    truth = plain.truth()
    lean = math.sin(truth.roll)
    np.testing.assert_allclose(difference[:2, 4], -0.5 * truth.normal_force[:2] * lean, rtol=0.01)


def turning(given=L60, seconds=2.0):
    """A machine in a steady left turn."""
    plant = Plant(given, speed=4.0, articulation_angle=0.35)
    plant.advance(Commands(), seconds)
    return plant


@pytest.mark.parametrize("name", ["cornering_curve", "resistance_curve"])
def test_a_curve_is_the_broken_line_through_its_knots(name):
    knots = sys.modules[f"plant.effects.library.{name}"].KNOTS
    values = np.array([0.1, -0.3, 0.25, 0.05])
    x = np.linspace(0.0, 1.5 * knots[-1], 301)
    np.testing.assert_allclose([between_knots(v, knots, values) for v in x], np.interp(x, knots, values))


def test_a_cornering_curve_adds_its_share_of_each_lateral_force():
    """By NumPy's interpolation at the slip angle of each wheel, of which the four in a turn differ."""
    plant = turning()
    before = evaluated(plant)
    shares = {"at_0": 0.3, "at_0_03": -0.2, "at_0_08": 0.1, "at_0_2": -0.4}
    after = evaluated(plant, machine("cornering_curve", **shares))
    slip = np.abs(before.state[s.TAN_ALPHA : s.TAN_ALPHA + 4])
    assert np.ptp(slip) > 0.005
    expected = 1.0 + np.interp(slip, (0.0, 0.03, 0.08, 0.2), tuple(shares.values()))
    lateral = before.work.tyres[:, s.T_LATERAL]
    np.testing.assert_allclose(after.work.tyres[:, s.T_LATERAL], expected * lateral, rtol=1e-12)
    # the force acts where the tyre touches the ground, and no moment about the road's normal comes with it
    difference = np.linalg.norm(wrenches(after)[:, 3:] - wrenches(before)[:, 3:], axis=1)
    np.testing.assert_allclose(difference, np.abs((expected - 1.0) * lateral), rtol=1e-9)


def test_an_even_resistance_curve_is_rolling_resistance():
    values = dict.fromkeys(("at_0_5", "at_1_5", "at_3", "at_6"), 0.03)
    by_curve = coast(machine("resistance_curve", **values), 3.0)
    by_load = coast(machine("rolling_resistance", coefficient=0.03, growth_per_m_per_s=0.0), 3.0)
    assert by_curve == pytest.approx(by_load, rel=1e-12)


def test_a_resistance_curve_is_a_moment_about_each_axle():
    """By NumPy's interpolation at what a free tyre of that spin would roll; nothing but the moment is added."""
    values = {"at_0_5": 0.01, "at_1_5": 0.05, "at_3": 0.02, "at_6": 0.04}
    for speed in (-2.25, 1.0, 4.5):
        plant = Plant(L60, speed=speed)
        plain = evaluated(plant)
        difference = wrenches(evaluated(plant, machine("resistance_curve", **values))) - wrenches(plain)
        truth, radius = plant.truth(), front(L60)[W_RADIUS]
        shares = np.interp(np.abs(truth.wheel_speed) * radius, (0.5, 1.5, 3.0, 6.0), tuple(values.values()))
        expected = -np.sign(speed) * shares * truth.normal_force * radius
        np.testing.assert_allclose(difference[:, 1], expected, rtol=1e-3)
        np.testing.assert_allclose(difference[:, [0, 2, 3, 4, 5]], 0.0, atol=1.0)


def test_turn_slip_is_a_parking_moment_that_fades_with_speed():
    """Steering at standstill the front wheels turn with their frame and creep along by half the track."""
    given = machine("turn_slip", friction=0.75, pressure_bar=3.5, length_m=0.25)
    plant = Plant(given)
    plant.advance(Commands(brake_torque=(30e3,) * 4, articulation_rate=0.3), 0.3)
    truth = plant.truth()
    moment = evaluated(plant).work.tyres[:, s.T_ALIGNING] - evaluated(plant, L60).work.tyres[:, s.T_ALIGNING]
    full = 0.75 * truth.normal_force**1.5 / (3.0 * math.sqrt(3.5e5))
    turning_rate = truth.angular_velocity[2] + truth.articulation_rate
    c, sn = math.cos(truth.articulation_angle), math.sin(truth.articulation_angle)
    for wheel, side in ((0, 1.0), (1, -1.0)):
        ahead = (
            c * truth.velocity[0] + sn * truth.velocity[1] - turning_rate * side * L60.geometry.track / 2.0
        )
        expected = -full[wheel] * math.tanh(0.25 * turning_rate / (abs(ahead) + 0.02))
        assert moment[wheel] == pytest.approx(expected, rel=0.03)
    fast = turning(given)
    moment = evaluated(fast).work.tyres[:, s.T_ALIGNING] - evaluated(fast, L60).work.tyres[:, s.T_ALIGNING]
    assert np.all(np.abs(moment) < 0.06 * full)


def test_turn_slip_shows_in_the_steering_torque():
    torques = []
    for given in (machine("turn_slip"), L60):
        plant = Plant(strong(given))
        torques.append(
            run(plant, 1.0, Commands(brake_torque=(30e3,) * 4, articulation_rate=0.2))
            .joint_torque[-30:]
            .mean()
        )
    assert torques[0] > torques[1] + 500.0


def test_lateral_deflection_shifts_each_load_by_its_side_force():
    """Moment of a load that has moved by force times compliance, by the cross product."""
    plant = turning()
    shifted = machine("lateral_deflection", compliance_mm_per_kN=2.5)
    seen = evaluated(plant)
    difference = wrenches(evaluated(plant, shifted)) - wrenches(seen)
    assert difference[:, 3:] == pytest.approx(0.0, abs=1e-6)
    for wheel in range(4):
        tyre, normal = seen.work.tyres[wheel], seen.work.normal
        axle = seen.work.places.axles[wheel]
        side = axle - normal * (axle @ normal)
        side /= np.linalg.norm(side)
        expected = np.cross(2.5e-6 * tyre[s.T_LATERAL] * side, tyre[s.T_NORMAL] * normal)
        np.testing.assert_allclose(difference[wheel, :3], expected, rtol=1e-9, atol=1e-6)
    np.testing.assert_array_equal(np.sign(difference[:, 0]), np.sign(seen.work.tyres[:, s.T_LATERAL]))


def test_lateral_deflection_brings_the_inner_wheels_nearer_to_lift_off():
    loads = [turning(given).truth().normal_force for given in (L60, machine("lateral_deflection"))]
    assert loads[1][0] < loads[0][0] - 100.0
    assert loads[1][1] > loads[0][1] + 100.0


def test_worn_tyres_turn_faster_at_the_same_speed():
    def per_speed(given):
        truth = Plant(given, speed=5.0).truth()
        return truth.wheel_speed / truth.speed

    for worn, axle, other in (("front_mm", slice(0, 2), slice(2, 4)), ("rear_mm", slice(2, 4), slice(0, 2))):
        values = {"front_mm": 0.0, "rear_mm": 0.0} | {worn: 20.0}
        ratio = per_speed(machine("tyre_wear", **values)) / per_speed(L60)
        assert ratio[axle] == pytest.approx(0.743 / 0.723, abs=0.004)
        assert ratio[other] == pytest.approx(1.0, abs=1e-4)


def test_pressure_stiffens_the_tyre_as_the_machine_sheet_says():
    w, plain = front(machine("inflation_pressure", front_bar=0.7, rear_bar=0.0)), front(L60)
    stiffer = radial_force(w, 0.04, 0.0) / radial_force(plain, 0.04, 0.0)
    assert stiffer == pytest.approx(1.0 + L60.tyre.pfz1 * 0.7 / 3.5, rel=1e-9)
    plain = Plant(L60).truth().tyre_deflection
    for front_bar, rear_bar in ((0.4, 0.0), (0.0, 0.4)):  # only the tyres that were filled rise
        filled = Plant(machine("inflation_pressure", front_bar=front_bar, rear_bar=rear_bar)).truth()
        less = plain - filled.tyre_deflection
        assert np.all((less > 1e-3) == (np.array((front_bar, front_bar, rear_bar, rear_bar)) > 0.0))


def ringing(given, seconds=3.0):
    """Vertical force of the front axle after a bump, about its mean [N]."""
    plant = Plant(given, speed=2.0)
    run(plant, 0.2, Commands(brake_torque=(15e3,) * 4))
    seen = run(plant, seconds, Commands())
    force = seen.normal_force[:, 0]
    return force - force[-50:].mean()


def test_less_damping_rings_longer():
    def energy(force):
        return float(np.sum(force[100:] ** 2) / np.sum(force[:100] ** 2))

    assert energy(ringing(machine("vertical_damping", damping=0.4))) > 2.0 * energy(ringing(L60))
    w = front(machine("vertical_damping", damping=0.4, stiffness=1.2))
    assert w[W_DAMPING] == pytest.approx(0.4 * L60.tyre.damping)
    assert radial_force(w, 0.03, 0.0) == pytest.approx(1.2 * radial_force(front(L60), 0.03, 0.0))


@pytest.mark.parametrize("frequency", [1.0, 2.0, 3.5, 5.0])
def test_hysteresis_loses_the_same_share_at_every_frequency(frequency):
    """The tyre shaken by hand: loss per cycle over 2 pi times the stored energy is the loss factor."""
    from plant.effects.library.hysteretic_damping import before_tyre
    from plant.physics.parameters import W_ADDED_LOAD
    from plant.physics.workspace import new_workspace

    given = machine("hysteretic_damping", loss_factor=0.15)
    p = parameter_vector(given, Surface(), 0.0)
    block = p[P_WHEELS : P_WHEELS + WHEEL_SIZE]
    work, state, q = new_workspace(), np.zeros(s.STATES), np.array((0.15, 0.0))
    work.normal[:] = work.places.axles[0] = (0.0, 0.0, 1.0)
    work.places.axles[0] = (0.0, 1.0, 0.0)
    middle, amplitude, step = 0.045, 1e-3, 1e-4
    own, x = s.EXTRA, s.EXTRA
    state[own : own + 2] = middle
    loss, cycles = 0.0, 12
    per = round(1.0 / frequency / step)
    for i in range(cycles * per):
        angle = 2.0 * math.pi * i / per
        deflection = middle + amplitude * math.sin(angle)
        work.local[0] = block
        work.places.centres[0] = (0.0, 0.0, block[W_RADIUS] - deflection)
        before_tyre(q, x, state, p, 0, work)
        state[own : own + 2] += step * work.rate[own : own + 2]
        if i >= (cycles - 1) * per:
            loss += work.local[0, W_ADDED_LOAD] * amplitude * math.cos(angle) * 2.0 * math.pi / per
    stiffness = (radial_force(block, middle + 1e-5, 0.0) - radial_force(block, middle - 1e-5, 0.0)) / 2e-5
    assert loss / (math.pi * stiffness * amplitude**2) == pytest.approx(0.15, rel=0.06)


def test_hysteresis_does_not_change_how_the_machine_stands():
    np.testing.assert_allclose(
        Plant(machine("hysteretic_damping")).truth().normal_force, Plant(L60).truth().normal_force, rtol=1e-6
    )
