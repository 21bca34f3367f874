"""Relief valves and stroke ends: complementarity, virtual work, energy; MuJoCo has the efforts that the accelerations take."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from plant.physics import state as s
from plant.physics.dynamics import derivative
from plant.physics.linkage import (
    K_LIFT_ROD,
    K_TILT_BACK,
    K_TILT_HEAD,
    K_TILT_ROD,
    LINKAGE,
    lift_cylinder,
    tilt_cylinder,
)
from plant.physics.parameters import (
    P_CYLINDERS,
    P_GUARD,
    P_LIFT,
    P_LINKAGE,
    P_STEERING,
    P_TILT,
    SERVO_RELIEF,
    parameter_vector,
)
from plant.physics.relief import (
    change_at_bounds,
    forces,
    lift_bounds,
    steering_bounds,
    surely_within,
    tilt_bounds,
)
from plant.physics.relief_guard import G_COUPLING, G_LIFT, G_STEERING, G_STROKES, G_TILT, GUARD
from plant.physics.steering import STEERING, torques_per_pressure
from plant.physics.surface import Surface
from plant.physics.workspace import new_workspace
from plant.plant import Commands, Plant
from plant.sheets.machine import load_machine
from tests.plant.oracle.loader import DRIVEN, MujocoLoader
from tests.plant.physics.test_linkage import lengths_by_closing_the_loop
from tests.plant.physics.test_mujoco import in_world, random_state

MACHINES = pytest.mark.parametrize("name", ["l60", "compact"])
HELD = (2e4,) * 4


def relieved(name, **pressures):
    """A machine with other relief pressures [Pa], by section."""
    machine = load_machine(name)
    parts = {
        section: replace(getattr(machine, section), relief_pressure=value)
        for section, value in pressures.items()
    }
    return replace(machine, **parts)


@MACHINES
def test_a_cylinder_gives_its_rate_or_its_relief_pressure(name):
    """Random states. Within bounds the joint is accelerated as demanded; at a bound it is not, and gives way to the load.

    Forces from MuJoCo's efforts for the accelerations found: 1e-9 of the largest effort.
    """
    machine = relieved(name, steering=8e6, lift=8e6, tilt=8e6)
    payload = 0.5 * machine.payload.reference_mass
    rng, work = np.random.default_rng(5), new_workspace()
    p = parameter_vector(machine, Surface(), payload)
    oracle = MujocoLoader(machine, p, payload_mass=payload)
    opened = np.zeros(3, int)
    for _ in range(60):
        state, command = random_state(rng, payload)
        derivative(state, command, p, 0.0, work, None)
        tree = work.tree
        oracle.set_state(state)
        oracle.locate()
        torque = state[s.DRIVE : s.DRIVE + 4] - state[s.STICK : s.STICK + 4] * state[s.BRAKE : s.BRAKE + 4]
        found = tree.joint_acceleration[list(DRIVEN)]
        _, efforts = oracle.solve(oracle.applied(torque, in_world(work, state)), found)
        np.testing.assert_allclose(
            tree.effort[list(DRIVEN)], efforts, rtol=0, atol=1e-9 * np.abs(efforts).max()
        )
        demanded = oracle.demanded(*command[s.C_ARTICULATION_RATE :])
        short = np.array((found[0] - demanded[0], found[1] - demanded[1], (found - demanded)[1:].sum()))
        bounds = (steering_bounds(state, p), lift_bounds(state, p), tilt_bounds(state, p))
        for i, (force, (low, high)) in enumerate(zip(forces(state, p, tree), bounds, strict=True)):
            slack = 1e-8 * (high - low)
            assert low - slack <= force <= high + slack
            at_bound = min(force - low, high - force) < slack
            assert at_bound or abs(short[i]) < 1e-9 * np.abs(found).max()
            opened[i] += at_bound
    assert opened.min() > 3, "hardly a valve opened"
    assert opened.max() < 58, "no valve stayed closed"


@pytest.mark.parametrize("name", ["l60", "l60_shaft", "compact"])
def test_where_the_guard_says_so_no_valve_would_open(name):
    """Angles over all strokes, their ends among them, and efforts up to and beyond the guard's: the full check is its witness."""
    rng, tree = np.random.default_rng(3), new_workspace().tree
    said = opened = 0
    for relief in (8e6, 2e7, math.inf):
        machine = relieved(name, steering=relief, lift=relief, tilt=relief)
        p = parameter_vector(machine, Surface(), 0.0)
        g, state = p[P_GUARD : P_GUARD + GUARD], np.zeros(s.STATES)
        finite = np.where(np.isfinite(g), g, np.sign(g) * 1e9)
        for angles in corners_and_between(g[G_STROKES : G_STROKES + 6].reshape(3, 2), rng, 2000):
            state[s.JOINT + s.FRONT_FRAME], state[s.JOINT + s.LIFT_ARM], state[s.JOINT + s.BUCKET] = angles
            tree.driven[s.FRONT_FRAME] = 1.0
            tilting = share(rng) * rng.choice(finite[G_TILT : G_TILT + 2])
            shared = finite[G_COUPLING] * abs(tilting)
            low, high = finite[G_LIFT] + shared, finite[G_LIFT + 1] - shared
            tree.effort[s.BUCKET] = tilting
            tree.effort[s.LIFT_ARM] = share(rng) * rng.choice((low, high))
            tree.effort[s.FRONT_FRAME] = share(rng) * rng.choice((-1.0, 1.0)) * finite[G_STEERING]
            bounds = (steering_bounds(state, p), lift_bounds(state, p), tilt_bounds(state, p))
            opens = any(
                not low <= force <= high
                for force, (low, high) in zip(forces(state, p, tree), bounds, strict=True)
            )
            fine = surely_within(state, p, tree)
            assert not (fine and opens)
            said, opened = said + fine, opened + opens
    assert said > 1000, "the guard never spares the check"
    assert opened > 300, "no valve was near to opening"


def corners_and_between(strokes, rng, count):
    """Angles of the three joints: every combination of stroke ends, then by chance."""
    yield from itertools.product(*strokes)
    yield from rng.uniform(strokes[:, 0], strokes[:, 1], (count, 3))


def share(rng):
    """Of a bound: often just within it, sometimes beyond."""
    return rng.choice((rng.uniform(0.0, 1.0), 1.0 - 1e-12, rng.uniform(1.0, 1.3)))


@MACHINES
def test_the_guard_knows_the_least_arms_of_the_stroke(name):
    """Against ten times as many angles, none of them a point of the guard's own but the ends: within one per cent, on the safe side."""
    machine = load_machine(name)
    p = parameter_vector(machine, Surface(), 0.0)
    g, k = p[P_GUARD : P_GUARD + GUARD], p[P_LINKAGE : P_LINKAGE + LINKAGE]
    _, arms, buckets = (np.linspace(low, high, 701) for low, high in g[:6].reshape(3, 2))
    tilting = np.array([tilt_cylinder(k, arm, bucket)[1:] for arm in arms[::5] for bucket in buckets])
    push = p[P_TILT + SERVO_RELIEF] * k[K_TILT_HEAD] - k[K_TILT_BACK] * k[K_TILT_ROD]
    assert 0.985 < g[G_TILT + 1] / (push * tilting[:, 0].min()) < 1.0
    assert 1.0 < g[G_COUPLING] / np.abs(tilting[:, 1] / tilting[:, 0]).max() < 1.015
    pull = p[P_LIFT + SERVO_RELIEF] * k[K_LIFT_ROD]
    assert 0.985 < -g[G_LIFT] / (pull * min(lift_cylinder(k, arm)[1] for arm in arms)) < 1.0


def test_a_linkage_that_passes_its_dead_centre_has_no_guard():
    """Where an arm of the moment is nothing no effort is small enough."""
    machine = load_machine("l60")
    across = replace(machine.steering, limit=math.radians(85.0), front_pin_x=0.05, front_pin_y=0.3)
    p = parameter_vector(replace(machine, steering=across), Surface(), 0.0)
    k = p[P_CYLINDERS : P_CYLINDERS + STEERING]
    assert min(torques_per_pressure(k, angle)[0] for angle in np.linspace(-1.48, 1.48, 99)) < 0.0
    assert math.isnan(p[P_GUARD + G_STEERING])


@MACHINES
def test_a_drive_is_the_same_to_the_bit_without_the_guard(name):
    """Valves open in it: the bucket is rolled back and the arm lowered into relief pressures that are too low."""
    guarded, plain = (
        Plant(relieved(name, lift=7e6, tilt=7e6), payload_mass=800.0, speed=2.0) for _ in range(2)
    )
    plain._parameters[P_GUARD : P_GUARD + GUARD] = math.nan
    for tick in range(150):
        rate = 0.3 * math.sin(0.05 * tick)
        commands = Commands(
            wheel_torque=(800.0,) * 4, articulation_rate=rate, lift_rate=rate, tilt_rate=0.5 * rate
        )
        guarded.advance(commands, 0.01)
        plain.advance(commands, 0.01)
        np.testing.assert_array_equal(guarded._state, plain._state)


def test_each_bound_holds_where_one_cylinder_loads_another():
    """Two coupled joints by hand: the first is cut to 1, which loads the second by 3; it is cut to 4 as well."""
    slope = np.array(((2.0, -1.0), (-1.5, 3.0)))
    low, high = np.array((-9.0, -9.0)), np.array((1.0, 4.0))
    change = change_at_bounds(np.array((5.0, 3.0)), slope, low, high)
    np.testing.assert_allclose(np.array((5.0, 3.0)) + slope @ change, (1.0, 4.0))
    np.testing.assert_array_equal(change_at_bounds(np.array((0.5, 3.0)), slope, low, high), 0.0)
    assert change_at_bounds(np.array((0.5, 4.6)), slope, low, high) == pytest.approx((0.0, -0.2))


@MACHINES
@pytest.mark.parametrize("share", [0.9, 1.1])
def test_the_arm_sinks_where_its_load_needs_more_than_the_relief_pressure(name, share):
    """Relief set about the pressure at rest: above it the arm holds, below it the arm sinks at that pressure."""
    load = load_machine(name).payload.reference_mass
    start = {"payload_mass": load, "lift_arm_angle": 0.0}
    at_rest = Plant(load_machine(name), **start).truth().lift_pressure
    plant = Plant(relieved(name, lift=at_rest * share), **start)
    for _ in range(50):
        plant.advance(Commands(brake_torque=HELD), 0.01)
        assert plant.truth().lift_pressure <= at_rest * share * (1 + 1e-9)
    if share < 1.0:
        assert plant.truth().lift_arm_angle < -0.05
        assert plant.truth().lift_pressure == pytest.approx(at_rest * share, rel=1e-9)
    else:
        assert plant.truth().lift_arm_angle == pytest.approx(0.0, abs=1e-5)


@MACHINES
def test_pressure_times_area_times_stroke_is_the_joints_work_at_the_relief(name):
    """Power of lift and tilt cylinders is that of the joints' torques, while the lift gives way: 1e-6."""
    machine = relieved(name, lift=7e6)
    plant = Plant(machine, payload_mass=machine.payload.reference_mass, lift_arm_angle=0.3)
    plant.advance(Commands(brake_torque=HELD, lift_rate=0.1), 0.3)
    truth, effort, h = plant.truth(), plant._work.tree.effort, 1e-6
    assert truth.lift_arm_rate < -0.05
    assert truth.lift_pressure == pytest.approx(7e6, rel=1e-9)
    before, after = (
        lengths_by_closing_the_loop(
            machine,
            truth.lift_arm_angle + way * truth.lift_arm_rate,
            truth.tilt_angle + way * truth.tilt_rate,
        )
        for way in (-h, h)
    )
    parts = (machine.lift, machine.tilt)
    head = np.array([part.cylinder_count * math.pi / 4 * part.bore**2 for part in parts])
    rod = head - [part.cylinder_count * math.pi / 4 * part.rod**2 for part in parts]
    force = np.array((truth.lift_pressure, truth.tilt_pressure)) * head - parts[0].back_pressure * rod
    joints = effort[s.LIFT_ARM] * truth.lift_arm_rate
    joints += effort[s.BUCKET] * (truth.tilt_rate - truth.lift_arm_rate)
    assert force @ (after - before) / (2 * h) == pytest.approx(joints, rel=1e-6)


@MACHINES
def test_a_sinking_arm_stops_at_its_stroke_end(name):
    """It passes the end by what it still goes in the stop's 10 ms, its rate only falls from there, and it stays."""
    machine = relieved(name, lift=6e6)
    end = machine.lift.lower_limit
    plant = Plant(
        machine, payload_mass=machine.payload.reference_mass, lift_arm_angle=end + 0.15, step_s=5e-4
    )
    rates, angles = [], []
    for _ in range(1200):
        plant.advance(Commands(brake_torque=HELD), 1e-3)
        truth = plant.truth()
        assert truth.lift_pressure <= 6e6 * (1 + 1e-9)
        rates.append(truth.lift_arm_rate)
        angles.append(truth.lift_arm_angle)
    met = int(np.argmax(np.array(angles) <= end))
    assert met > 0
    assert rates[met] < -0.1
    assert min(angles) > end + 1.1 * rates[met] * 0.01
    assert min(rates[met:]) >= rates[met]
    assert max(rates[met:]) < 0.05 * abs(rates[met])
    assert min(angles) <= angles[-1] <= end


@MACHINES
def test_steering_stalls_at_its_relief_pressure(name):
    """On the spot, with a relief below what the tyres' scrub takes: the pushing line stays at it, and the joint hardly turns."""
    free, stalled = Plant(load_machine(name)), Plant(relieved(name, steering=6e6), payload_mass=0.0)
    turning = Commands(brake_torque=HELD, articulation_rate=0.3)
    highest = 0.0
    for _ in range(100):
        free.advance(turning, 0.01)
        stalled.advance(turning, 0.01)
        highest = max(highest, free.truth().steering_pressure[0])
        assert max(stalled.truth().steering_pressure) <= 6e6 * (1 + 1e-9)
    assert highest > 6e6
    assert highest <= load_machine(name).steering.relief_pressure * (1 + 1e-9)
    assert stalled.truth().articulation_angle < 0.9 * free.truth().articulation_angle


def test_no_relief_is_a_machine_that_does_what_it_is_asked():
    """Infinite relief pressures: every driven joint has its demanded acceleration."""
    p = parameter_vector(load_machine("l60"), Surface(), 3204.0)
    p[[P_STEERING + SERVO_RELIEF, P_LIFT + SERVO_RELIEF, P_TILT + SERVO_RELIEF]] = math.inf
    rng, work = np.random.default_rng(7), new_workspace()
    oracle = MujocoLoader(load_machine("l60"), p, payload_mass=3204.0)
    for _ in range(20):
        state, command = random_state(rng, 3204.0)
        derivative(state, command, p, 0.0, work, None)
        oracle.set_state(state)
        np.testing.assert_allclose(
            work.tree.joint_acceleration[list(DRIVEN)], oracle.demanded(*command[s.C_ARTICULATION_RATE :])
        )
