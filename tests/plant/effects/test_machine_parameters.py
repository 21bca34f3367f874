"""Frames, joints, drive and tyres: what each parameter of an effect adds at one instant, by the effect's equation."""

import math

import numpy as np
import pytest

from plant.effects import dispatch, find_effect
from plant.effects.registry import modules
from plant.physics import state as s
from plant.physics.parameters import (
    B_REAR_FRAME,
    P_WHEELS,
    W_DAMPING,
    W_PRESSURE,
    W_RADIUS,
    WHEEL_SIZE,
    parameter_vector,
)
from plant.physics.surface import Surface
from plant.plant import Plant
from tests.plant.effects.trial import GRAVITY, L60, MASS, coast, evaluated, machine, rolling_mass, run


def first(name):
    """Index of an effect's first own state."""
    return dispatch._first_states(modules())[name]


def at(given, states):
    """The equations of motion of a machine that rolls straight ahead, with some states at other values."""
    plant = Plant(given, speed=2.0)
    for index, value in states.items():
        plant._state[index] = value
    return evaluated(plant).work


def wheels(given, field):
    """One parameter of the four wheels."""
    p = parameter_vector(given, Surface(), 0.0)
    return p[P_WHEELS + field :: WHEEL_SIZE][:4].copy()


@pytest.mark.parametrize(("front", "rear"), [(20.0, 5.0), (0.0, 30.0)])
def test_wear_takes_its_own_tyres_radius(front, rear):
    lost = wheels(L60, W_RADIUS) - wheels(machine("tyre_wear", front_mm=front, rear_mm=rear), W_RADIUS)
    np.testing.assert_allclose(lost, 1e-3 * np.array((front, front, rear, rear)), atol=1e-12)


@pytest.mark.parametrize(("front", "rear"), [(0.5, -0.3), (0.0, 0.6)])
def test_pressure_changes_in_its_own_tyres(front, rear):
    """In shares of the nominal pressure [bar]."""
    given = machine("inflation_pressure", front_bar=front, rear_bar=rear)
    more = wheels(given, W_PRESSURE) - wheels(L60, W_PRESSURE)
    expected = np.array((front, front, rear, rear)) / L60.tyre.nominal_pressure
    np.testing.assert_allclose(more, expected, atol=1e-12)


@pytest.mark.parametrize("higher", [-150.0, 200.0])
def test_the_rear_frames_centre_is_as_much_higher(higher):
    p, plain = (
        parameter_vector(given, Surface(), 0.0)
        for given in (machine("mass_split", forward_kg=0.0, higher_mm=higher), L60)
    )
    assert p[B_REAR_FRAME + 3] - plain[B_REAR_FRAME + 3] == pytest.approx(1e-3 * higher)


@pytest.mark.parametrize("behind", [150.0, -200.0])
def test_a_rear_axle_further_behind_carries_less_of_what_is_ahead_of_it(behind):
    """Moments about the rear axle: it moves by d, and its own weight with it. 0.5 %: tyres give way, and the machine pitches."""
    truth, plain = (
        Plant(given).truth() for given in (machine("axle_position", front_mm=0.0, rear_mm=behind), L60)
    )
    base, d = L60.geometry.front_axle_x - L60.geometry.rear_axle_x, 1e-3 * behind
    ahead = MASS - L60.rear_axle.mass - 2.0 * L60.wheel.mass
    expected = (plain.normal_force[:2].sum() * base + ahead * GRAVITY * d) / (base + d)
    assert truth.normal_force[:2].sum() == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize("height", [1.5, 3.0])
def test_drag_higher_up_leans_the_machine_back(height):
    """Force times height over the wheelbase goes from the front axle to the rear one."""
    low, high = (
        run(Plant(machine("aerodynamic_drag", drag_area_m2=20.0, height_m=h), speed=9.0), 2.0)
        for h in (0.0, height)
    )
    drag = 0.5 * 1.2 * 20.0 * float(low.speed[-50:].mean()) ** 2
    less = (low.normal_force - high.normal_force)[-50:, :2].sum(axis=1).mean()
    base = L60.geometry.front_axle_x - L60.geometry.rear_axle_x
    assert less == pytest.approx(drag * height / base, rel=0.03)


@pytest.mark.parametrize("tau", [50.0, 300.0])
def test_brakes_cool_with_their_time_constant(tau):
    x = first("brake_fade")
    work = at(machine("brake_fade", cooling_s=tau), {x: 100.0, x + 1: 40.0})
    assert work.rate[x : x + 2] == pytest.approx((-100.0 / tau, -40.0 / tau))


@pytest.mark.parametrize("zeta", [0.05, 0.3])
def test_a_swinging_load_is_damped_by_twice_zeta_omega(zeta):
    x, omega = first("payload_slosh"), math.tau * 0.8
    given = machine("payload_slosh", damping=zeta, frequency_hz=0.8)
    still, moving = (at(given, {x + 1: speed}).rate[x + 1] for speed in (0.0, 0.2))
    assert moving - still == pytest.approx(-2.0 * zeta * omega * 0.2)


@pytest.mark.parametrize("mass", [100.0, 300.0])
def test_a_swung_out_load_pulls_its_bucket_by_mass_omega_squared_and_way(mass):
    x, omega = first("payload_slosh"), math.tau * 0.8
    given = machine("payload_slosh", mass_kg=mass, frequency_hz=0.8)
    still, away = (at(given, {x: way}).tree.bias[s.BUCKET, 3:].copy() for way in (0.0, 0.1))
    assert np.linalg.norm(away - still) == pytest.approx(mass * omega**2 * 0.1, rel=1e-6)


@pytest.mark.parametrize(("stiffness", "damping"), [(1e6, 1e4), (4e6, 3e4)])
def test_the_oil_of_the_steering_is_spring_and_damper(stiffness, damping):
    """k times the way that the cylinders are ahead of the frames, c times how much faster they are."""
    x, effort = first("steering_compliance"), []
    given = machine("steering_compliance", stiffness_N_m_per_rad=stiffness, damping_N_m_s_per_rad=damping)
    for ahead, faster in ((0.0, 0.0), (0.01, 0.0), (0.0, 0.1)):
        effort.append(at(given, {x: ahead, x + 1: faster}).tree.effort[s.FRONT_FRAME])
    assert effort[1] - effort[0] == pytest.approx(stiffness * 0.01)
    assert effort[2] - effort[0] == pytest.approx(damping * 0.1)


@pytest.mark.parametrize(("play", "stiffness", "damping"), [(0.5, 4e6, 2e4), (1.0, 2e6, 5e4)])
def test_beyond_its_play_the_steering_is_spring_and_damper(play, stiffness, damping):
    x, width, effort = first("steering_play"), math.radians(play), []
    given = machine(
        "steering_play",
        play_deg=play,
        stiffness_N_m_per_rad=stiffness,
        damping_N_m_s_per_rad=damping,
    )
    for ahead, faster in ((0.9 * width, 0.1), (width + 0.01, 0.0), (width + 0.01, 0.1), (-width - 0.01, 0.0)):
        effort.append(at(given, {x: ahead, x + 1: faster}).tree.effort[s.FRONT_FRAME])
    assert effort[1] - effort[0] == pytest.approx(stiffness * 0.01)
    assert effort[2] - effort[1] == pytest.approx(damping * 0.1)
    assert effort[3] - effort[0] == pytest.approx(-stiffness * 0.01)


@pytest.mark.parametrize(("stiffness", "damping"), [(1e5, 500.0), (3e5, 900.0)])
def test_a_wound_up_shaft_brakes_one_axle_and_drives_the_other(stiffness, damping):
    """k times the wind-up and c times the difference of the axles' speeds, half of it at each wheel."""
    x, wheel = first("driveline_torsion"), s.JOINT_RATE + s.WHEEL
    given = machine("driveline_torsion", stiffness_N_m_per_rad=stiffness, damping_N_m_s_per_rad=damping)
    rolling = Plant(given, speed=2.0)._state[wheel : wheel + 4].copy()
    faster = {wheel + k: rolling[k] + (0.1 if k < 2 else 0.0) for k in range(4)}
    still, wound, quick = (
        at(given, states).tree.effort[s.WHEEL : s.WHEEL + 4].copy() for states in ({}, {x: 0.02}, faster)
    )
    sides = np.array((-0.5, -0.5, 0.5, 0.5))
    np.testing.assert_allclose(wound - still, sides * stiffness * 0.02, rtol=1e-9)
    np.testing.assert_allclose(quick - still, sides * damping * 0.1, rtol=1e-6)


@pytest.mark.parametrize("constant", [30.0, 100.0])
def test_the_twist_of_the_frame_follows_within_its_time_constant(constant):
    """What is missing to compliance times moment, over the time constant."""
    x = first("frame_torsion")
    given = machine("frame_torsion", compliance_mrad_per_kN_m=2.0, time_constant_ms=constant)
    work = at(given, {x: 0.003})
    moment = 0.5 * L60.geometry.track * (work.tyres[0, s.T_NORMAL] - work.tyres[1, s.T_NORMAL])
    assert work.rate[x] == pytest.approx((2e-6 * moment - 0.003) / (1e-3 * constant), rel=1e-6)


@pytest.mark.parametrize("share", [-1.0, 0.5])
def test_a_share_of_the_gyroscopic_moment_is_added(share):
    """Spin momentum across the turning of each wheel, times the share."""
    plant = Plant(L60, speed=6.0, articulation_angle=0.3)  # one motion: each machine would start its own
    plain = evaluated(plant).work
    more = evaluated(plant, machine("wheel_gyroscopics", share=share)).work
    added = (more.tree.bias - plain.tree.bias)[s.WHEEL : s.WHEEL + 4, :3]
    for wheel in range(4):
        axle, turning = plain.places.axles[wheel], plain.tree.motion[s.WHEEL + wheel, :3]
        momentum = L60.wheel.spin_inertia * float(turning @ axle) * axle
        np.testing.assert_allclose(added[wheel], share * np.cross(turning, momentum), atol=1e-6)


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_the_viscous_damper_is_kept_by_its_share(share):
    work = at(machine("hysteretic_damping", viscous_share=share), {})
    np.testing.assert_allclose(work.local[:, W_DAMPING], share * wheels(L60, W_DAMPING))


@pytest.mark.parametrize("hertz", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("loss", [0.1, 0.3])
def test_the_loss_factor_is_that_of_a_swing_about_the_standing_load(loss, hertz):
    """Energy lost in a swing over 2 pi times that of the spring, from the complex stiffness of the two elements; 15 %."""
    from plant.effects.library.hysteretic_damping import SHARE, TIMES

    (given,) = machine("hysteretic_damping", loss_factor=loss).effects
    omega = math.tau * hertz
    lossy = sum(SHARE * given.values[0] * (1j * omega * t) / (1.0 + 1j * omega * t) for t in TIMES)
    assert lossy.imag == pytest.approx(loss, rel=0.15)


@pytest.mark.parametrize(("cohesive", "frictional", "width"), [(0.99, 1528.0, 0.52), (13.0, 700.0, 0.4)])
def test_the_rut_bears_the_load_by_bekkers_law(cohesive, frictional, width):
    """p = (k_c/b + k_phi) z^n over the patch of b by its length."""
    from plant.effects.library.soil_sinkage import sinkage

    (given,) = machine(
        "soil_sinkage",
        exponent=0.8,
        cohesive_kN_per_m_n1=cohesive,
        frictional_kN_per_m_n2=frictional,
        width_m=width,
        patch_m=0.5,
    ).effects
    depth = sinkage(29e3, np.array(given.values))
    pressure = 1e3 * (cohesive / width + frictional) * depth**0.8
    assert pressure * width * 0.5 == pytest.approx(29e3, rel=1e-9)


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_the_axle_behind_runs_in_the_ruts_of_the_first(share):
    """Its resistance is that share of a first pass; 5 %: loads while it slows down."""
    from plant.effects.library.soil_sinkage import compaction, sinkage

    given = machine("soil_sinkage", second_pass=share)
    q = np.array(given.effects[0].values)
    loads = Plant(given).truth().normal_force
    resistance = np.array([compaction(sinkage(load, q), q) for load in loads])
    slope, _ = coast(given, 3.0, seconds=0.5, settle=0.5)
    assert -slope * rolling_mass() == pytest.approx(resistance @ (1.0, 1.0, share, share), rel=0.05)


@pytest.mark.parametrize(("most", "depth", "share"), [(60e3, 0.5, 0.5), (40e3, 0.3, 1.0)])
def test_what_was_dug_weighs_on_the_bucket(most, depth, share):
    """c F_max (1 - exp(-s/s0)) at a depth of s; the machine has backed out: nothing resists it."""
    x = first("pile_entry")
    given = machine("pile_entry", distance_m=50.0, most_N=most, depth_m=depth, weight_share=share)
    fresh, dug = (at(given, {x: way}).tree.bias[s.BUCKET, 3:].copy() for way in (0.0, 0.4))
    expected = share * most * (1.0 - math.exp(-0.4 / depth))
    assert np.linalg.norm(dug - fresh) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("ahead", "above", "distance"), [(0.82, 0.0, 5.0), (0.3, 0.5, 4.0), (0.82, 0.88, 6.0)]
)
def test_the_pile_resists_from_where_its_edge_meets_it(ahead, above, distance):
    """The edge lies ahead of the bucket's pin and above it, turned with the bucket.

    The pile is loose at first: at a depth s it has taken F_max s^2 / 2 s0 of the machine's energy. 4 cm: two samples at 2 m/s.
    """
    given = machine("pile_entry", distance_m=distance, edge_x_m=ahead, edge_z_m=above)
    places = at(given, {}).places
    pin, axes = places.points[3], places.axes[4]
    edge = pin[0] + ahead * axes[0, 0] + above * axes[0, 2]
    seen = run(Plant(given, speed=2.0), (distance - edge) / 2.0 + 0.5)
    slower = 0.02
    slowed = np.flatnonzero(seen.speed < seen.speed[0] - slower)
    pile = find_effect("pile_entry").typical().named
    into = math.sqrt(2.0 * pile["depth_m"] / pile["most_N"] * rolling_mass() * 2.0 * slower)
    assert seen.position[slowed[0], 0] + edge == pytest.approx(distance + into, abs=0.04)


@pytest.mark.parametrize(("speed", "most", "depth"), [(1.4, 60e3, 0.5), (2.5, 60e3, 0.5), (1.4, 30e3, 0.3)])
def test_a_pile_takes_the_work_of_the_resistance_that_grows_with_the_depth(speed, most, depth):
    """The integral of F_max (1 - exp(-s/s0)) over the depth dug is what the machine brought, less what tyres and the packed pile take: 5 %.

    A force beyond that resistance would leave a shallower hole.
    """
    given = machine("pile_entry", distance_m=4.0, most_N=most, depth_m=depth, weight_share=0.0)
    plant, x = Plant(given, speed=speed), first("pile_entry")
    while plant.truth().speed > 0.0:
        run(plant, 0.01)
    dug = plant._state[x]
    work = most * (dug - depth * (1.0 - math.exp(-dug / depth)))
    brought = rolling_mass() * speed**2 / 2.0
    assert 0.95 * brought < work < brought


@pytest.mark.parametrize(
    ("depth", "deepest", "expected"),
    [
        (-0.01, 0.0, 0.0),  # not reached yet
        (
            0.2,
            0.0,
            60e3 * (1.0 - math.exp(-0.4)),
        ),  # digs: what the depth bears, however far the memory is behind
        (0.2, 0.2, 60e3 * (1.0 - math.exp(-0.4))),
        (0.195, 0.2, 60e3 * (1.0 - math.exp(-0.4)) - 5e-3 * 2e6),  # 5 mm back: the packed pile's spring
        (0.18, 0.2, 0.0),  # and gone after 1 cm
    ],
)
def test_a_pile_bears_what_its_depth_does_and_springs_back_from_its_deepest(depth, deepest, expected):
    x = first("pile_entry")
    given, far = (
        machine("pile_entry", distance_m=distance, most_N=60e3, depth_m=0.5, weight_share=0.0)
        for distance in (10.0, 1e3)
    )
    pile, places = find_effect("pile_entry").typical().named, at(given, {}).places
    edge = places.world[0] @ (places.points[3] + places.axes[4] @ (pile["edge_x_m"], 0.0, pile["edge_z_m"]))
    into = {s.POSITION: 10.0 + depth - edge, s.VELOCITY: 0.0}
    pushed, free = (at(g, into | {x: deepest}).tree.bias[s.BUCKET, 3:].copy() for g in (given, far))
    assert np.linalg.norm(pushed - free) == pytest.approx(expected, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("above", [0.3, 0.9])
def test_the_pile_pushes_at_the_place_of_the_edge(above):
    """The moment about the joint is that of the force at the edge."""
    given, far = (
        machine("pile_entry", distance_m=distance, edge_x_m=0.8, edge_z_m=above) for distance in (10.0, 1e3)
    )
    places = at(given, {}).places
    axes = places.axes[4]
    edge = places.points[3] + 0.8 * axes[:, 0] + above * axes[:, 2]
    into = {s.POSITION: 10.05 - edge[0]}
    pushed, free = (at(g, into).tree.bias[s.BUCKET].copy() for g in (given, far))
    moment, force = np.split(pushed - free, 2)
    assert np.linalg.norm(force) > 1e3
    np.testing.assert_allclose(moment, np.cross(edge, force), atol=1e-6 * np.linalg.norm(force))
