"""Road, soil and terrain: each effect against the balance of forces that its equation states."""

import itertools
import math

import numpy as np
import pytest

from plant.physics.surface import Surface
from plant.plant import Commands, Plant
from tests.plant.effects.trial import GRAVITY, L60, MASS, coast, machine, rolling_mass, run

LEVER = L60.tyre.radius / 0.727  # the moment is with the unloaded radius, the force acts at the rolling one


@pytest.mark.parametrize("speed", [4.0, -4.0])
def test_rolling_resistance_slows_in_both_directions(speed):
    given = machine("rolling_resistance", coefficient=0.03, growth_per_m_per_s=0.0)
    slope, _ = coast(given, speed)
    assert -slope * math.copysign(1.0, speed) == pytest.approx(
        0.03 * LEVER * MASS * GRAVITY / rolling_mass(), rel=0.01
    )


def test_rolling_resistance_grows_with_load_and_speed():
    given = machine("rolling_resistance", coefficient=0.03, growth_per_m_per_s=0.05)
    slope, speed = coast(given, 6.0)
    expected = 0.03 * LEVER * (1.0 + 0.05 * speed) * MASS * GRAVITY / rolling_mass()
    assert slope == pytest.approx(-expected, rel=0.015)
    laden, speed = coast(given, 6.0, payload_mass=3204.0)
    expected = 0.03 * LEVER * (1.0 + 0.05 * speed) * (MASS + 3204.0) * GRAVITY / (rolling_mass() + 3204.0)
    assert laden == pytest.approx(-expected, rel=0.015)


def test_aerodynamic_drag_grows_with_the_square_of_the_speed():
    given = machine("aerodynamic_drag", drag_area_m2=20.0)
    for start in (9.0, 4.5):
        slope, speed = coast(given, start)
        assert slope == pytest.approx(-0.5 * 1.2 * 20.0 * speed**2 / rolling_mass(), rel=0.02)


@pytest.mark.parametrize(("grade", "bank"), [(4.0, 0.0), (0.0, 5.0), (3.0, -4.0)])
def test_grade_is_the_slope_of_a_road(grade, bank):
    """The same motion as on a surface with that grade and bank, which is made another way."""
    surface = Surface(grade=math.radians(grade), bank=math.radians(bank))
    a = run(Plant(machine("grade", grade_deg=grade, bank_deg=bank), speed=3.0), 1.0)
    b = run(Plant(L60, speed=3.0, surface=surface), 1.0)
    np.testing.assert_allclose(a.normal_force, b.normal_force, rtol=1e-6)
    np.testing.assert_allclose(a.speed, b.speed, rtol=1e-9)


def test_grade_shows_in_the_accelerometer_but_not_in_the_wheels():
    angle = math.radians(5.0)
    still = Plant(machine("grade", grade_deg=5.0)).truth()
    nose_up = -still.pitch
    weight = GRAVITY * np.array((math.sin(nose_up), 0.0, math.cos(nose_up)))
    np.testing.assert_allclose(still.imu_specific_force, weight, atol=1e-6)
    assert nose_up == pytest.approx(angle, abs=0.01)  # and what the softer rear tyres add
    assert still.normal_force.sum() == pytest.approx(MASS * GRAVITY * math.cos(angle), rel=1e-4)
    uphill, _ = coast(machine("grade", grade_deg=5.0), 5.0)
    downhill, _ = coast(machine("grade", grade_deg=5.0), -5.0)
    for slope in (uphill, downhill):  # against the motion one way, with it the other
        assert slope == pytest.approx(-MASS * GRAVITY * math.sin(angle) / rolling_mass(), rel=0.02)


def braking(given, speed=8.0, friction=0.4):
    """Deceleration [m/s²] with locked wheels on wet ground, and speed."""
    plant = Plant(given, speed=speed, surface=Surface(friction=friction))
    locked = Commands(brake_torque=(30e3,) * 4)
    run(plant, 0.6, locked)
    seen = run(plant, 0.15, locked)
    assert np.all(seen.wheel_speed == 0.0)
    return -float(np.mean(seen.acceleration[:, 0])), float(seen.speed.mean())


def test_surface_friction_is_another_ground():
    """Half the friction everywhere is the ground with half the friction."""
    scaled, _ = braking(machine("surface_friction", left=0.5, right=0.5), friction=0.4)
    assert scaled == pytest.approx(braking(L60, friction=0.2)[0], rel=1e-9)
    assert scaled < 0.55 * braking(L60, friction=0.4)[0]


def test_split_friction_turns_the_machine_to_the_side_that_grips():
    plant = Plant(machine("surface_friction", left=0.3, right=1.0), speed=6.0)
    seen = run(plant, 0.5, Commands(brake_torque=(12e3,) * 4))
    assert seen.angular_velocity[-1, 2] < -0.02  # to the right


@pytest.mark.parametrize("start", [9.0, 6.0])
def test_velocity_dependent_friction_falls_with_the_sliding_speed(start):
    """Locked wheels slide at the speed of the machine: as on ground with so much less friction."""
    slower, speed = braking(machine("velocity_dependent_friction", decay_s_per_m=0.06), start)
    assert slower == pytest.approx(braking(L60, start, 0.4 / (1.0 + 0.06 * speed))[0], rel=0.05)


def test_soil_sinkage_in_dry_sand():
    """Worked values: 29 kN on a patch of 0.52 m by 0.48 m in dry sand sinks 96 mm and resists with 2.7 kN."""
    from plant.effects.library.soil_sinkage import compaction, sinkage

    q = np.array((1.1, 0.99e3, 1528e3, 0.52, 0.48, 0.4, 1.0))
    depth = sinkage(29e3, q)
    assert depth == pytest.approx(0.096, abs=0.001)
    assert compaction(depth, q) == pytest.approx(2.7e3, rel=0.03)
    work, steps = 0.0, np.linspace(0.0, depth, 2001)  # pressing the rut: pressure times width over the depth
    for z in 0.5 * (steps[1:] + steps[:-1]):
        work += (0.99e3 / 0.52 + 1528e3) * z**1.1 * 0.52 * (steps[1] - steps[0])
    assert compaction(depth, q) == pytest.approx(work, rel=1e-5)


def test_soil_sinkage_lowers_the_machine_and_resists():
    """Each wheel by its own load; the rear wheels press what the front wheels have left. 5 %: loads while it slows down."""
    from plant.effects.library.soil_sinkage import compaction, sinkage

    given = machine("soil_sinkage")
    q = np.array(given.effects[0].values)
    standing, level = Plant(given).truth(), Plant(L60).truth()
    depths = np.array([sinkage(load, q) for load in standing.normal_force])
    assert level.position[2] - standing.position[2] == pytest.approx(depths.mean(), rel=0.02)
    slope, _ = coast(given, 3.0, seconds=0.5, settle=0.5)
    resistance = np.array([compaction(depth, q) for depth in depths])
    assert -slope * rolling_mass() == pytest.approx(resistance @ (1.0, 1.0, q[5], q[5]), rel=0.05)


def test_soil_shear_has_no_peak():
    """Traction still rises with slip where the road tyre's is past its peak."""
    from plant.physics.parameters import P_WHEELS, WHEEL_SIZE, parameter_vector
    from plant.physics.tyre import combined_forces, stiffness_and_peak

    def force(given, kappa):
        w = parameter_vector(given, Surface(), 0.0)[P_WHEELS : P_WHEELS + WHEEL_SIZE]
        return combined_forces(w, 30e3, stiffness_and_peak(w, 1.0, 30e3), kappa, 0.0)[0]

    soft = machine("soil_shear", friction_angle_deg=30.0, shear_mm=15.0, patch_m=0.48)
    rising = [force(soft, kappa) for kappa in (0.05, 0.1, 0.2, 0.4, 0.8)]
    assert all(b > a for a, b in itertools.pairwise(rising))
    for kappa in (0.02, 0.1, 0.4):
        x = kappa * 0.48 / (2.0 * 0.015)
        assert force(soft, kappa) == pytest.approx(
            30e3 * math.tan(math.radians(30)) * x / math.sqrt(1 + x * x), rel=1e-9
        )
    assert force(L60, 0.8) < max(force(L60, kappa) for kappa in (0.1, 0.15, 0.2, 0.3))


def test_bulldozing_is_a_force_against_each_wheel():
    plain, _ = coast(machine("soil_shear", bulldozing_N=0.0), 3.0)
    pushed, _ = coast(machine("soil_shear", bulldozing_N=500.0), 3.0)
    assert (plain - pushed) * rolling_mass() == pytest.approx(4 * 500.0, rel=0.02)


def test_kerb_lifts_front_then_rear():
    """Loads jump where front and rear wheels come to the step, a wheelbase apart; afterwards all stand higher."""
    plant = Plant(machine("kerb", distance_m=3.0, length_m=0.5, left_m=0.03, right_m=0.03), speed=2.0)
    seen = run(plant, 4.0)
    front, rear = (seen.position[np.argmax(seen.tyre_deflection[:, wheel]), 0] for wheel in (0, 2))
    assert rear - front == pytest.approx(3.0, abs=0.15)
    assert seen.position[-1, 2] - seen.position[0, 2] == pytest.approx(0.03, abs=0.003)


def test_a_step_under_the_left_wheels_leans_the_machine():
    """Standing on it throughout: the front axle, which does not oscillate, leans by height over track."""
    truth = Plant(machine("kerb", distance_m=-100.0, length_m=1.0, left_m=0.12, right_m=0.0)).truth()
    assert truth.roll == pytest.approx(math.atan(0.12 / L60.geometry.track), rel=0.1)


def test_ditch_is_left_as_it_was_entered():
    plant = Plant(machine("ditch", distance_m=2.5, length_m=1.5, left_m=0.1, right_m=0.1), speed=2.0)
    seen = run(plant, 6.0)
    assert np.ptp(seen.normal_force[:, 0]) > 5e3
    assert seen.position[-1, 2] == pytest.approx(seen.position[0, 2], abs=0.003)


@pytest.mark.parametrize(("name", "shape"), [("kerb", {"length_m": 2.0}), ("enveloped_step", {})])
@pytest.mark.parametrize("step", [0.02, -0.02])
def test_a_step_costs_what_the_machine_is_lifted_by(name, shape, step):
    """At 1.2 m/s with both sides: kinetic energy lost is potential energy gained. 4 %: tyres' dampers, and swinging."""
    plant = Plant(machine(name, distance_m=4.0, left_m=step, right_m=step, **shape), speed=1.2)
    plant.advance(Commands(), 8.0)
    truth = plant.truth()
    assert truth.position[0] > 7.0
    assert rolling_mass() * (1.2**2 - truth.speed**2) / 2.0 == pytest.approx(MASS * GRAVITY * step, rel=0.04)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("ditch", {"distance_m": 3.0, "length_m": 16.0, "left_m": 0.3, "right_m": 0.3}),
        ("washboard", {"amplitude_mm": 150.0, "wavelength_m": 20.0}),
    ],
)
def test_the_speed_in_a_hollow_is_that_of_the_fall(name, values):
    """At any time what the speed has gained the height has given. 5 % of the deepest fall: dampers, and how it pitches."""
    plant = Plant(machine(name, **values), speed=1.5)
    seen = run(plant, 6.0)
    gained = rolling_mass() * (seen.speed**2 - 1.5**2) / 2.0
    fallen = MASS * GRAVITY * (seen.position[0, 2] - seen.position[:, 2])
    assert np.ptp(fallen) > 0.1 * MASS * GRAVITY
    np.testing.assert_allclose(gained, fallen, rtol=0, atol=0.05 * np.ptp(fallen))


def tone(values, step=0.01):
    """Frequency of the strongest part [Hz], to a hundredth of the band."""
    values = (values - values.mean()) * np.hanning(len(values))
    spectrum = np.abs(np.fft.rfft(values, 16 * len(values)))
    return np.fft.rfftfreq(16 * len(values), step)[np.argmax(spectrum)]


@pytest.mark.parametrize("speed", [2.0, 4.0])
def test_washboard_sounds_at_speed_over_wavelength(speed):
    plant = Plant(machine("washboard", amplitude_mm=2.0, wavelength_m=2.0), speed=speed)
    run(plant, 2.0)
    seen = run(plant, 6.0)
    assert tone(seen.normal_force[:, 0]) == pytest.approx(seen.speed.mean() / 2.0, rel=0.03)


@pytest.mark.parametrize("speed", [1.0, 2.0])
def test_lugs_sound_at_their_number_times_the_wheel(speed):
    plant = Plant(machine("lug_excitation", amplitude_mm=0.5, lugs=22.0), speed=speed)
    run(plant, 2.0)
    seen = run(plant, 4.0)
    wheel = seen.wheel_speed[:, 0].mean() / (2.0 * math.pi)
    assert tone(seen.normal_force[:, 0]) == pytest.approx(22.0 * wheel, rel=0.02)
