"""Frames, joints and drive: each effect against the law that its equation states."""

import math

import numpy as np
import pytest

from plant.effects import dispatch
from plant.effects.registry import modules
from plant.physics import state as s
from plant.physics.parameters import (
    B_BUCKET,
    B_FRONT_FRAME,
    B_LIFT_ARM,
    B_REAR_FRAME,
    P_STOP_ANGLE,
    parameter_vector,
)
from plant.physics.surface import Surface
from plant.plant import Commands, Plant
from tests.plant.effects.trial import (
    GRAVITY,
    L60,
    MASS,
    coast,
    evaluated,
    machine,
    rolling_mass,
    run,
    spin_inertia,
    strong,
)


def vector(given):
    return parameter_vector(given, Surface(), 0.0)


def twisting(given, rate):
    """Moment on the rear axle's pivot at an oscillation rate."""
    plant = Plant(given, speed=1.0)
    plant._state[s.JOINT_RATE + s.REAR_AXLE] = rate
    return float(evaluated(plant).work.tree.effort[s.REAR_AXLE])


@pytest.mark.parametrize("rate", [0.05, -0.05, 0.2])
def test_pivot_friction_is_constant_against_the_twist(rate):
    assert twisting(machine("pivot_friction", torque_N_m=700.0), rate) == pytest.approx(
        -math.copysign(700.0, rate), rel=1e-6
    )


def test_pivot_friction_leaves_a_loop_in_the_rear_loads():
    """Over a bump under the left rear wheel the rear loads differ by friction over half the track, up and down."""

    def loop(given):
        plant = Plant(given, speed=1.0)
        seen = run(plant, 6.0)
        return np.ptp(seen.normal_force[:, 2] - seen.normal_force[:, 3])

    from dataclasses import replace

    from plant.effects import find_effect

    bump = find_effect("ditch").of(distance_m=1.0, length_m=3.0, left_m=-0.06, right_m=0.0)
    free, rubbing = (
        replace(L60, effects=(bump, *more))
        for more in ((), (find_effect("pivot_friction").of(torque_N_m=3e3),))
    )
    assert loop(rubbing) > 2.0 * 3e3 / (L60.geometry.track / 2.0) > 2.0 * loop(free)


def test_stops_act_where_they_are_said_to():
    p = vector(machine("oscillation_stops", narrower_deg=8.0, stiffness=2.0))
    assert p[P_STOP_ANGLE] == pytest.approx(L60.oscillation.limit - math.radians(8.0))
    plant = Plant(machine("oscillation_stops", narrower_deg=8.0, stiffness=2.0), speed=1.0)
    plant._state[s.JOINT + s.REAR_AXLE] = L60.oscillation.limit - math.radians(8.0) + 0.01
    assert evaluated(plant).work.tree.effort[s.REAR_AXLE] == pytest.approx(
        -2.0 * L60.oscillation.stop_stiffness * 0.01
    )
    plant._state[s.JOINT + s.REAR_AXLE] = L60.oscillation.limit - math.radians(8.0) - 0.01
    assert evaluated(plant).work.tree.effort[s.REAR_AXLE] == 0.0


@pytest.mark.parametrize(("name", "axis"), [("roll_inertia", 0), ("yaw_inertia", 2)])
def test_inertia_needs_as_much_more_moment(name, axis):
    """The inertia of the bodies about their own centres, by the factor given and no other."""
    plain, changed = vector(L60), vector(machine(name, front=1.5, rear=0.8))
    for start, factor in ((B_FRONT_FRAME, 1.5), (B_REAR_FRAME, 0.8)):
        expected = plain[start : start + 10].copy()
        expected[4 + axis] *= factor
        np.testing.assert_allclose(changed[start : start + 10], expected, rtol=1e-12)


def test_roll_inertia_lowers_the_roll_frequency():
    """Pushed into roll while rolling straight: the period grows."""

    def period(given):
        plant = Plant(given, speed=2.0)
        plant._state[s.ANGULAR] = 0.05
        rate = run(plant, 3.0).angular_velocity[:, 0]
        return np.diff(np.flatnonzero(np.diff(np.sign(rate)) > 0)).mean()

    assert period(machine("roll_inertia", front=2.5, rear=2.5)) > 1.15 * period(L60)


def test_yaw_inertia_shows_in_the_joint_torque_while_the_yaw_rate_changes():
    def peak(given):
        return np.abs(run(Plant(given, speed=3.0), 0.3, Commands(articulation_rate=0.4)).joint_torque).max()

    assert peak(machine("yaw_inertia", front=1.6, rear=1.6)) > 1.1 * peak(L60)


def test_axles_stand_where_they_are_put():
    """Front axle load by the lever law about the rear axle."""
    truth, plain = (Plant(g).truth() for g in (machine("axle_position", front_mm=200.0, rear_mm=0.0), L60))
    front = plain.normal_force[:2].sum()
    moved = L60.wheel.mass * 2 * GRAVITY  # the wheels themselves move with the axle
    expected = (front * 3.0 + moved * 0.2) / 3.2
    assert truth.normal_force[:2].sum() == pytest.approx(expected, rel=2e-3)
    assert truth.normal_force.sum() == pytest.approx(plain.normal_force.sum(), rel=1e-9)


def test_an_unequal_joint_turns_the_rear_frame_while_steering_on_the_move():
    """Rolling without slip: (V sin d + l_f dd/dt)/(l_r + l_f cos d) for the rear frame, signs of ISO."""
    rates = []
    for given, (ahead, behind) in (
        (L60, (1.5, 1.5)),
        (machine("axle_position", front_mm=400.0, rear_mm=0.0), (1.9, 1.5)),
    ):
        plant = Plant(given, speed=3.0, articulation_angle=0.3)
        seen = run(plant, 1.5)
        speed, angle = seen.speed[-20:].mean(), seen.articulation_angle[-1]
        kinematic = speed * math.sin(angle) / (ahead + behind * math.cos(angle))
        rates.append((seen.angular_velocity[-20:, 2].mean(), kinematic))
    (plain, plain_law), (moved, moved_law) = rates
    assert moved / plain == pytest.approx(moved_law / plain_law, rel=0.03)


def test_mass_split_moves_weight_and_keeps_it():
    truth, plain = (Plant(g).truth() for g in (machine("mass_split", forward_kg=400.0, higher_mm=0.0), L60))
    assert truth.normal_force.sum() == pytest.approx(plain.normal_force.sum(), rel=1e-6)
    front, axle = L60.front_frame, L60.front_axle  # one body
    way = (front.mass * front.x + axle.mass * axle.x) / (front.mass + axle.mass) - L60.rear_frame.x
    assert truth.normal_force[:2].sum() - plain.normal_force[:2].sum() == pytest.approx(
        400.0 * GRAVITY * way / 3.0, rel=0.01
    )


def test_a_higher_centre_transfers_more_load_in_proportion_to_the_acceleration():
    def transfer(given):
        seen = run(Plant(given, speed=5.0, articulation_angle=0.3), 1.5)
        return seen.load_transfer_ratio[-30:].mean() / seen.cog_specific_force[-30:, 1].mean()

    share = 6018.0 * 0.2 / (MASS * 1.1)
    assert transfer(machine("mass_split", forward_kg=0.0, higher_mm=200.0)) / transfer(L60) == pytest.approx(
        1.0 + share, rel=0.05
    )


def test_payload_error_is_payload():
    a = Plant(machine("payload_mass", extra_kg=800.0), payload_mass=1000.0).truth()
    b = Plant(L60, payload_mass=1800.0).truth()
    np.testing.assert_allclose(a.normal_force, b.normal_force, rtol=1e-9)
    assert a.lift_pressure == pytest.approx(b.lift_pressure, rel=1e-9)
    empty = vector(machine("payload_mass", extra_kg=-500.0))
    assert empty[B_BUCKET] == pytest.approx(L60.bucket.mass - 500.0)


def test_slosh_swings_at_its_own_frequency_and_hangs_where_it_is_pushed():
    """Freely on a straight course; in a steady turn it hangs at the side force over its spring."""
    given = machine("payload_slosh", mass_kg=200.0, frequency_hz=0.8, damping=0.02)
    plant = Plant(given, speed=3.0)
    first = dispatch._first_states(modules())["payload_slosh"]
    plant._state[first] = 0.05
    history = []
    for _ in range(500):
        plant.advance(Commands(), 0.01)
        history.append(plant._state[first])
    crossings = np.flatnonzero(np.diff(np.sign(history)) > 0)
    assert np.diff(crossings).mean() * 0.01 == pytest.approx(1.0 / 0.8, rel=0.03)


def test_lift_arm_inertia_shows_in_the_torque_while_the_arm_accelerates():
    """Inertia times the arm's angular acceleration against the ground: the frame, too, is pitched by it."""
    p = vector(machine("lift_arm_inertia", inertia_kg_m2=5000.0, higher_mm=100.0))
    expected = vector(L60)[B_LIFT_ARM : B_LIFT_ARM + 10].copy()
    expected[[3, 5, 6]] += 0.1, 5000.0, 5000.0  # mass along the arm resists pitch and yaw alike
    np.testing.assert_allclose(p[B_LIFT_ARM : B_LIFT_ARM + 10], expected, rtol=1e-12)
    torque = []
    for given in (machine("lift_arm_inertia", inertia_kg_m2=5000.0, higher_mm=0.0), L60):
        plant = Plant(given)
        plant.advance(Commands(brake_torque=(30e3,) * 4, lift_rate=0.2), 0.001)
        tree = evaluated(plant).work.tree
        torque.append(
            (tree.effort[s.LIFT_ARM], tree.joint_acceleration[s.LIFT_ARM], -tree.acceleration[s.LIFT_ARM, 1])
        )
    more = torque[0][0] - torque[1][0]
    assert 0.4 * 5000.0 * torque[0][1] < more < 5000.0 * torque[0][1]
    assert 0.0 < torque[0][2] < torque[0][1]


def accelerating(given, torque=2000.0):
    plant = Plant(given, speed=2.0)
    seen = run(plant, 1.0, Commands(wheel_torque=(torque,) * 4))
    return (seen.speed[-1] - seen.speed[49]) / (seen.time_s[-1] - seen.time_s[49]), seen


def test_what_turns_with_the_wheels_takes_its_torque():
    slope, _ = accelerating(machine("wheel_spin_inertia", extra_kg_m2=200.0))
    plain, _ = accelerating(L60)
    assert slope / plain == pytest.approx(rolling_mass() / rolling_mass(extra=200.0), rel=5e-3)


def test_gyroscopic_moment_is_yaw_rate_times_spin_momentum():
    """By the cross product, on the wheels of a machine in a turn; -1 takes all of it away."""
    plant = Plant(L60, speed=6.0, articulation_angle=0.3)
    plant.advance(Commands(), 1.0)
    seen = evaluated(plant)
    tree = seen.work.tree
    expected = np.zeros(3)
    for wheel, inertia in enumerate(spin_inertia(seen.p)):
        axle, turning = seen.work.places.axles[wheel], tree.motion[s.WHEEL + wheel, :3]
        expected -= np.cross(turning, inertia * float(turning @ axle) * axle)
    from plant.effects.library.wheel_gyroscopics import bodies

    before = tree.bias[s.WHEEL : s.WHEEL + 4].copy()
    bodies(np.array((1.0,)), s.EXTRA, seen.state, seen.p, seen.work)
    moment = -(tree.bias[s.WHEEL : s.WHEEL + 4] - before)[:, :3].sum(axis=0)
    np.testing.assert_allclose(moment, expected, rtol=1e-9, atol=1e-9)
    assert abs(moment[0]) > 0.01 * MASS * abs(plant.truth().cog_specific_force[1]) * 1.1


def test_torsion_rolls_the_rear_frame_by_the_moment_of_the_front_axle():
    given = machine("frame_torsion", compliance_mrad_per_kN_m=2.0, time_constant_ms=30.0)
    turn = {"speed": 4.0, "articulation_angle": 0.3}
    soft, stiff = (run(Plant(g, **turn), 2.0) for g in (given, L60))
    moment = 0.5 * L60.geometry.track * (soft.normal_force[-1, 0] - soft.normal_force[-1, 1])

    def twist(seen):
        """Roll beyond that of the front axle on its tyres."""
        pressed = seen.tyre_deflection[-1]
        return seen.roll[-1] - (pressed[1] - pressed[0]) / L60.geometry.track

    assert twist(soft) - twist(stiff) == pytest.approx(-2e-6 * moment, rel=0.02)


def test_a_pile_stops_the_machine_and_loads_the_cylinders():
    given = machine("pile_entry", distance_m=5.0, most_N=60e3, depth_m=0.5, weight_share=0.5)
    plant = Plant(given, speed=2.0)
    seen = run(plant, 4.0, Commands(wheel_torque=(3000.0,) * 4))
    free = run(Plant(L60, speed=2.0), 4.0, Commands(wheel_torque=(3000.0,) * 4))
    pushing = 4 * 3000.0 / 0.727
    assert abs(seen.speed[-1]) < 0.1 < free.speed[-1]
    assert seen.longitudinal_force[-20:].sum(axis=1).mean() == pytest.approx(pushing, rel=0.05)
    assert np.abs(seen.lift_pressure[-50:].mean() - free.lift_pressure[0]) > 1e5
    weight = seen.normal_force[-100:].sum(axis=1).mean() - MASS * GRAVITY
    assert 0.5 * pushing * 0.8 < weight < 0.5 * 60e3  # what it digs bears at least what the machine pushes


def test_where_a_pile_is_touched_within_a_step_does_not_matter():
    """A pile a hair further away stops the machine a hair later: the speed afterwards is a smooth function of the distance.

    A force that jumped at the first touch would push for a whole step of the integration, wherever in it the touch was.
    """
    further = np.arange(10) * 0.3e-3  # two steps at 1.4 m/s
    left = []
    for more in further:
        given = machine("pile_entry", distance_m=4.0 + more, most_N=60e3, depth_m=0.5, weight_share=0.5)
        left.append(run(Plant(given, speed=1.4), 1.0).speed[-1])
    assert left[0] < 0.0, "it was stopped"
    line = np.polynomial.Polynomial.fit(further, left, 2)
    assert np.abs(left - line(further)).max() < 0.01 * np.ptp(left)


@pytest.mark.parametrize("further", [0.0, 2e-3, 5e-3])  # of the 7 mm that the machine goes in a long step
def test_a_pile_is_touched_alike_in_long_and_in_short_steps(further):
    """Replays take steps of 5 ms. A depth that follows in jerks makes single readings of the pressures that are far off, and jumps in what is fitted."""
    given = machine("pile_entry", distance_m=4.0 + further, most_N=60e3, depth_m=0.5, weight_share=0.5)
    short, long = (
        run(Plant(given, speed=1.4, step_s=step), 0.6).lift_pressure.ravel() for step in (1e-3, 5e-3)
    )
    assert np.abs(long - short).max() < 2e-3 * np.ptp(short)  # 0.0004; with jerks 0.04 to 0.22


def test_a_shaft_makes_the_axles_turn_together():
    """Worn front tyres want to turn faster; the shaft winds up until the speeds agree."""
    from dataclasses import replace

    from plant.effects import find_effect

    worn = find_effect("tyre_wear").of(front_mm=20.0, rear_mm=0.0)
    shaft = find_effect("driveline_torsion").typical()
    free, coupled = (
        run(Plant(replace(L60, effects=chosen), speed=4.0), 2.0) for chosen in ((worn,), (worn, shaft))
    )

    def difference(seen):
        mean = seen.wheel_speed[-20:].mean(axis=0)
        return mean[:2].mean() - mean[2:].mean()

    assert difference(free) > 0.1
    assert abs(difference(coupled)) < 0.01
    slip = coupled.slip[-20:].mean(axis=0)
    assert slip[0] < 0 < slip[2]  # the shaft brakes the faster front wheels and drives the rear ones


def test_a_lag_of_the_motors_is_a_time():
    """63 per cent of a step after the time constants one after the other."""
    plant = Plant(machine("motor_lag", lag_ms=200.0), speed=2.0)
    torque = []
    for _ in range(100):
        plant.advance(Commands(wheel_torque=(1000.0,) * 4), 0.01)
        torque.append(plant.truth().wheel_torque[0])
    assert np.interp(1000.0 * (1.0 - math.exp(-1.0)), torque, 0.01 * np.arange(1, 101)) == pytest.approx(
        0.2 + L60.drive.time_constant, abs=0.015
    )


def test_torque_error_is_in_the_motion_and_not_in_the_report():
    slope, seen = accelerating(machine("torque_error", front_percent=-10.0, rear_percent=-10.0))
    plain, reported = accelerating(L60)
    assert slope / plain == pytest.approx(0.9, rel=0.01)
    drive = seen.longitudinal_force[-1].sum() / reported.longitudinal_force[-1].sum()
    assert drive == pytest.approx(0.9, rel=0.02)


def test_brake_drag_does_not_grow_with_load_or_speed():
    given = machine("brake_drag", front_N_m=400.0, rear_N_m=400.0)
    for speed, payload in ((3.0, 0.0), (7.0, 0.0), (3.0, 3204.0)):
        slope, _ = coast(given, speed, payload_mass=payload)
        assert -slope * (rolling_mass() + payload) == pytest.approx(4 * 400.0 / 0.727, rel=0.02)


def test_brakes_fade_with_the_energy_they_took():
    """Torque lost on the road is fade times the rise in temperature: energy of one axle over its capacity; pressure does not enter."""
    given = machine("brake_fade", fade_per_K=0.004, capacity_J_per_K=2e3, cooling_s=1e4)
    plant = Plant(given, speed=9.0)
    brake = Commands(brake_torque=(3000.0,) * 4)
    run(plant, 0.4, brake)
    seen = run(plant, 1.5, brake)
    lost = np.diff(seen.speed)[[1, -1]] / 0.01 * rolling_mass() * 0.727 / 4.0
    energy = np.sum(-seen.wheel_torque[:, :2].sum(axis=1) * seen.wheel_speed[:, :2].mean(axis=1)) * 0.01
    assert lost[1] - lost[0] == pytest.approx(3000.0 * 0.004 * energy / 2e3, rel=0.1)
    assert seen.wheel_torque[-1] == pytest.approx(seen.wheel_torque[0], rel=1e-3)


def steering(given, seconds=1.5, rate=0.3, speed=3.0):
    return run(Plant(given, speed=speed), seconds, Commands(articulation_rate=rate))


def test_steering_compliance_rings_and_then_follows():
    soft, stiff = steering(machine("steering_compliance", stiffness_N_m_per_rad=1e6)), steering(L60)
    gap = soft.articulation_angle - stiff.articulation_angle
    assert np.abs(gap).max() > 2e-3
    assert abs(gap[-1]) < 0.1
    assert np.abs(np.diff(soft.articulation_rate)).max() > np.abs(np.diff(stiff.articulation_rate[20:])).max()


def test_steering_compliance_gives_by_torque_over_stiffness():
    """Held at an angle in a steady turn: the joint stands off by what the frames need."""
    given = machine("steering_compliance", stiffness_N_m_per_rad=1e6)
    plant = Plant(given, speed=4.0, articulation_angle=0.3)
    seen = run(plant, 4.0)
    torque = seen.joint_torque[-50:].mean()
    assert seen.articulation_angle[-50:].mean() - 0.3 == pytest.approx(-torque / 1e6, rel=0.02, abs=1e-5)


def test_play_swallows_small_motions():
    given = machine("steering_play", play_deg=1.0)
    seen = run(Plant(given), 0.5, Commands(brake_torque=(30e3,) * 4, articulation_rate=math.radians(1.5)))
    rigid = run(Plant(L60), 0.5, Commands(brake_torque=(30e3,) * 4, articulation_rate=math.radians(1.5)))
    assert math.degrees(rigid.articulation_angle[-1]) > 0.6
    assert abs(math.degrees(seen.articulation_angle[-1])) < 0.1


def test_play_is_crossed_after_its_width():
    given = machine("steering_play", play_deg=1.0)
    seen = run(Plant(given), 2.0, Commands(brake_torque=(30e3,) * 4, articulation_rate=math.radians(10.0)))
    rigid = run(
        Plant(strong(L60)), 2.0, Commands(brake_torque=(30e3,) * 4, articulation_rate=math.radians(10.0))
    )
    behind = np.degrees(rigid.articulation_angle[-30:] - seen.articulation_angle[-30:])
    pressed = np.degrees(seen.joint_torque[-30:].mean() / 4.4e6)  # of the contact behind the play
    assert behind.mean() == pytest.approx(1.0 + pressed, rel=0.05)


@pytest.mark.parametrize("rate", [0.2, -0.2])
def test_steering_friction_adds_to_the_joint_torque_against_the_motion(rate):
    rubbing, free = (
        steering(g, seconds=0.6, rate=rate) for g in (machine("steering_friction", torque_N_m=2000.0), L60)
    )
    difference = rubbing.joint_torque[-20:] - free.joint_torque[-20:]
    np.testing.assert_allclose(difference, math.copysign(2000.0, rate), rtol=1e-3)
