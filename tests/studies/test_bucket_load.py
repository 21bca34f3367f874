"""What the ECU makes of the cylinders' pressures: known loads through the plant's linkage, and a drive into a pile."""

import math

import numpy as np
import pytest

from ecu.calibration import load_calibration
from ecu.estimators.loads.linkage import levers
from ecu.estimators.loads.payload import followed_load, loaded, pushed, residual, weighs
from ecu.estimators.motion.arm import Turning
from ecu.estimators.quantities import Vector
from ecu.estimators.signals import Inputs
from ecu.estimators.state import INITIAL
from hil.compose import Choice, lockstep
from plant.physics.linkage import lift_cylinder, linkage_of, pressures, tilt_cylinder
from plant.sheets.machine import load_machine
from studies.campaigns.normal_force import errors_of, estimates_of

STILL = Turning(0.0, 0.0, 0.0, 0.0)
MACHINES = pytest.mark.parametrize("name", ["l60", "compact"])
POSES = [(-0.78, 0.0), (-0.65, 0.82), (0.0, 0.82), (0.3, 0.2)]
G = 9.81


def turned(x, z, angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array((x * c - z * s, x * s + z * c))


def torques(machine, arm, tilt, payload, force=(0.0, 0.0), ahead=0.0):
    """Torques at the joints of arm and bucket [N m] under gravity alone; force: on the edge; ahead: of the payload [m]."""
    edge = load_calibration(machine.family).parameters.digging
    pin = turned(machine.lift.arm_length, 0.0, arm)
    back = tilt - machine.tilt.carry_angle
    on_bucket = [
        (turned(machine.bucket.x, machine.bucket.z, back), (0.0, -G * machine.bucket.mass)),
        (turned(machine.payload.x, machine.payload.z, back) + np.array((ahead, 0.0)), (0.0, -G * payload)),
        (turned(edge.edge_forward, edge.edge_above, back), force),
    ]
    on_arm = [(turned(machine.lift_arm.x, machine.lift_arm.z, arm), (0.0, -G * machine.lift_arm.mass))]
    on_arm += [(pin + at, f) for at, f in on_bucket]

    def held(loads):
        return -sum(at[0] * f[1] - at[1] * f[0] for at, f in loads)

    return held(on_arm), held(on_bucket)


def inputs(machine, arm, tilt, **load):
    """The inputs that the ECU would get from a machine that stands level."""
    lift, back = pressures(
        linkage_of(machine.lift, machine.tilt), arm, tilt, *torques(machine, arm, tilt, **load)
    )
    given = dict.fromkeys(Inputs._fields, 0.0) | {"dt": 0.01, "pressure_usable": 1.0, "rate_limit": 1.0}
    given |= {"lift_pressure": lift, "tilt_pressure": back, "lift_arm_angle": arm, "tilt_angle": tilt}
    return Inputs(**given)


@MACHINES
@pytest.mark.parametrize(("arm", "tilt"), POSES)
def test_both_sides_have_the_same_levers(name, arm, tilt):
    """Equilibrium of pins there, derivatives of lengths here; written down apart, the angles to a rounding: 1e-4 m."""
    machine = load_machine(name)
    k, p = linkage_of(machine.lift, machine.tilt), load_calibration(machine.family).parameters
    found = levers(arm, tilt, p.arm, p.bucket, p.cylinders, p.tilt_linkage)
    _, on_bucket, on_arm = tilt_cylinder(k, arm, tilt)
    assert found == pytest.approx((lift_cylinder(k, arm)[1], on_arm, on_bucket), abs=1e-4)


@MACHINES
@pytest.mark.parametrize(("arm", "tilt"), POSES)
@pytest.mark.parametrize("ahead", [0.0, 0.2])
def test_a_payload_is_weighed_wherever_it_lies(name, arm, tilt, ahead):
    """To the calibration's rounding, 0.1 %; the couple is weight times how far ahead it lies, 1 % of a metre's."""
    machine = load_machine(name)
    p, mass = load_calibration(machine.family).parameters, machine.payload.reference_mass
    given = inputs(machine, arm, tilt, payload=mass, ahead=ahead)
    payload, couple = loaded(given, residual(given, 0.0, G, p), 0.0, G, p)
    assert payload == pytest.approx(mass, rel=1e-3)
    assert couple == pytest.approx(mass * G * ahead, abs=0.01 * mass * G)


@MACHINES
@pytest.mark.parametrize(("arm", "tilt"), [(-0.78, 0.0), (-0.7, 0.2), (-0.5, 0.1)])
@pytest.mark.parametrize("share", [(-0.5, -0.2), (-0.2, -0.1)])
def test_a_force_on_the_edge_follows_from_both_pressures(name, arm, tilt, share):
    """share: of the machine's weight. 1 % of the force: the calibration's rounding."""
    machine = load_machine(name)
    p, half = load_calibration(machine.family).parameters, 0.5 * machine.payload.reference_mass
    force = np.array(share) * machine.mass * G
    given = inputs(machine, arm, tilt, payload=half, force=tuple(force))
    assert given.tilt_pressure > 0.0
    found = pushed(given, residual(given, 0.0, G, p), half, 0.0, 0.0, Vector(0.0, 0.0, G), p)
    np.testing.assert_allclose(found, force, atol=0.01 * np.linalg.norm(force))


@MACHINES
def test_traction_stands_in_for_a_tilt_cylinder_that_pulls(name):
    """Bucket rolled back in the pile: its head side is empty; the vertical force from lift pressure and traction."""
    machine = load_machine(name)
    p, force = load_calibration(machine.family).parameters, np.array((-0.5, -0.2)) * machine.mass * G
    given = inputs(machine, -0.78, 0.8, payload=0.0, force=tuple(force))
    assert given.tilt_pressure == 0.0
    found = pushed(given, residual(given, 0.0, G, p), 0.0, 0.0, -force[0], Vector(0.0, 0.0, G), p)
    np.testing.assert_allclose(found, force, atol=0.01 * np.linalg.norm(force))


def follow(machine, given, state, *, cycles, traction):
    """The load after some cycles of the same inputs."""
    p = load_calibration(machine.family).parameters
    for _ in range(cycles):
        load = followed_load(
            given, state, residual(given, 0.0, G, p), Vector(0.0, 0.0, G), traction, 0.5, STILL, p
        )
        state = state._replace(
            cycles=state.cycles + 1, payload=load.payload, couple=load.couple, calm_payload=load.calm_payload,
            calm_couple=load.calm_couple, digging=load.digging, push_x=load.x, push_z=load.z, traction=load.traction,
        )  # fmt: skip
    return state


FALLING = Vector(0.0, 0.0, 0.1 * G)
THROWN_BACK = Vector(
    0.9 * G, 0.0, 0.3 * G
)  # with the arm high, a push ahead has nearly the weight's moment the other way


@MACHINES
@pytest.mark.parametrize("along", [FALLING, THROWN_BACK])
@pytest.mark.parametrize("digging", [0.0, 1.0])  # what was dug is taken over at once
def test_a_load_that_hardly_weighs_keeps_its_mass(name, along, digging):
    machine = load_machine(name)
    p, mass = load_calibration(machine.family).parameters, machine.payload.reference_mass
    given = inputs(machine, 0.7, 0.0, payload=mass)
    state = INITIAL._replace(
        cycles=100.0, payload=mass, couple=300.0, calm_payload=mass, calm_couple=300.0, digging=digging
    )
    load = followed_load(given, state, residual(given, along.x, along.z, p), along, 0.0, 0.5, STILL, p)
    assert (load.payload, load.couple) == (mass, 300.0)
    assert not weighs(given, along.x, along.z, p)
    assert weighs(given, 0.0, G, p)


@MACHINES
@pytest.mark.parametrize(("arm", "tilt"), POSES)
def test_no_bucket_carries_less_than_nothing(name, arm, tilt):
    """Without any pressure the balance asks for a load that pulls up."""
    machine = load_machine(name)
    p = load_calibration(machine.family).parameters
    given = inputs(machine, arm, tilt, payload=0.0)._replace(lift_pressure=0.0, tilt_pressure=0.0)
    payload, _ = loaded(given, residual(given, 0.0, G, p), 0.0, G, p)
    assert payload == -0.5 * p.bucket.mass


@MACHINES
def test_only_pressures_and_traction_together_make_a_pile(name):
    """Either witness alone changes the payload; both leave the payload and give the force; what was dug then stays."""
    machine = load_machine(name)
    weight = machine.mass * G
    free = inputs(machine, -0.78, 0.0, payload=0.0)
    into = inputs(machine, -0.78, 0.0, payload=0.0, force=(-0.4 * weight, -0.1 * weight))
    start = follow(machine, free, INITIAL, cycles=300, traction=0.0)
    assert start.digging == 0.0
    assert start.payload == pytest.approx(0.0, abs=0.01 * machine.mass)
    sand = follow(machine, free, start, cycles=100, traction=0.4 * weight)
    assert sand.digging == 0.0, "soft ground resists too"
    rock = follow(machine, into, start, cycles=100, traction=0.0)
    assert rock.digging == 0.0, "nothing pushes"
    pile = follow(machine, into, start, cycles=100, traction=0.4 * weight)
    assert pile.digging == 1.0
    assert pile.payload == pytest.approx(start.payload, abs=0.01 * machine.mass)
    assert (pile.push_x, pile.push_z) == pytest.approx((-0.4 * weight, -0.1 * weight), abs=0.02 * weight)
    full = inputs(machine, -0.78, 0.0, payload=machine.payload.reference_mass)
    out = follow(machine, full, pile, cycles=30, traction=0.0)
    assert out.digging == 0.0
    assert out.payload == pytest.approx(machine.payload.reference_mass, rel=0.02)


@pytest.mark.parametrize(("scenario", "bound"), [("pile_entry", 0.08), ("wheel_lock", 0.08)])
def test_normal_forces_in_pile_and_wheel_lock(scenario, bound):
    """RMS of each wheel against what it carries standing."""
    recording = lockstep(Choice(scenario=scenario).load(), limits=False, reference=False).run()
    time = np.array([truth.time_s for truth in recording.truth])
    force = np.array([truth.normal_force for truth in recording.truth])
    found = errors_of(estimates_of(recording), time, force)
    assert max(np.array(found["rms"]) / found["standing"]) < bound
    extreme = max(abs(truth.longitudinal_force.sum()) for truth in recording.truth)
    assert extreme > 40e3, "the case is what it says"
