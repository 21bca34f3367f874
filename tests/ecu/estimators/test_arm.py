"""A moving arm: rate and acceleration from samples, and forces that agree with the change of momentum of its parts."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ecu.calibration import load_calibration
from ecu.estimators.loads.arm_forces import NO_ARM_FORCES, arm_forces
from ecu.estimators.loads.cog import pose_at
from ecu.estimators.loads.linkage import levers
from ecu.estimators.loads.payload import BucketLoad, followed_load, lift_acceleration, residual
from ecu.estimators.motion.arm import Turning, moving, tracked
from ecu.estimators.parameters import GRAVITY
from ecu.estimators.quantities import Vector
from ecu.estimators.signals import Inputs
from ecu.estimators.state import INITIAL
from ecu.outputs import MOST_TICKS

P = load_calibration().parameters
ARM, BUCKET = P.arm, P.bucket
unhurried = settings(deadline=None, max_examples=30)


def turn(x, z, angle):
    """(x, z) as a complex number, turned up."""
    return complex(x, z) * np.exp(1j * angle)


def lumps(lift, tilt, payload):
    """Mass, place in the front frame, moment of inertia and angle of arm, bucket and payload."""
    pivot, pin = complex(ARM.pivot_x, ARM.pivot_z), turn(ARM.length, 0.0, lift)
    wrist = tilt - BUCKET.carried
    yield ARM.mass, pivot + turn(ARM.along, ARM.above, lift), ARM.pitch_inertia, lift
    yield BUCKET.mass, pivot + pin + turn(BUCKET.forward, BUCKET.above, wrist), BUCKET.pitch_inertia, tilt
    gyration = payload * BUCKET.payload_pitch_gyration**2
    yield payload, pivot + pin + turn(BUCKET.payload_forward, BUCKET.payload_above, wrist), gyration, tilt


def momenta(t, lift, tilt, payload, yaw_rate):
    """Linear and angular momentum about the joint in axes that do not turn, but coincide with the front frame's at t = 0."""
    h = 1e-4

    def points(at):
        angles = [part.angle + part.rate * at + part.acceleration * at * at / 2.0 for part in (lift, tilt)]
        c, s = math.cos(yaw_rate * at), math.sin(yaw_rate * at)
        return [
            (m, np.array((p.real * c, p.real * s, p.imag)), inertia, angle)
            for m, p, inertia, angle in lumps(*angles, payload)
        ]

    linear, angular = np.zeros(3), np.zeros(3)
    for (m, before, inertia, a0), (_, now, _, _), (_, after, _, a1) in zip(
        points(t - h), points(t), points(t + h), strict=True
    ):
        velocity = (after - before) / (2 * h)
        linear += m * velocity
        angular += m * np.cross(now, velocity) + np.array((0.0, -inertia * (a1 - a0) / (2 * h), 0.0))
    return linear, angular


def change(lift, tilt, payload, yaw_rate):
    """Rates of change of the momenta at t = 0."""
    h = 1e-3
    after, before = (momenta(t, lift, tilt, payload, yaw_rate) for t in (h, -h))
    return (after[0] - before[0]) / (2 * h), (after[1] - before[1]) / (2 * h)


parts = st.builds(Turning, st.floats(-0.7, 0.8), st.floats(0.1, 0.8), st.floats(-3.0, 3.0), st.just(0.0))


def forces(lift, tilt, yaw_rate, payload):
    pose = pose_at(lift.angle, tilt.angle, ARM, BUCKET)
    return arm_forces(pose, lift, tilt, yaw_rate, payload, ARM, BUCKET)


@unhurried
@given(parts, parts, st.floats(0.0, 4000.0), st.floats(-1.0, 1.0))
def test_the_forces_are_the_change_of_momentum_beyond_the_rigid_machines(lift, tilt, payload, yaw_rate):
    """Rigid: the same parts at rest on the front frame, in the same turn. The spin about x and z is left out."""
    still = (Turning(part.angle, 0.0, 0.0, 0.0) for part in (lift, tilt))
    moved, rigid = change(lift, tilt, payload, yaw_rate), change(*still, payload, yaw_rate)
    force, moment = moved[0] - rigid[0], moved[1] - rigid[1]
    found = forces(lift, tilt, yaw_rate, payload)
    scale = 1e4
    assert (found.x, found.y, found.z) == pytest.approx(tuple(force), abs=1e-4 * scale)
    # r x F: x = -z a_y, y = z a_x - x a_z, z = x a_y
    expected = (found.rolling, -found.pitching, found.yawing)
    assert expected == pytest.approx(tuple(moment), abs=1e-3 * scale)


def test_arm_and_bucket_at_rest_exert_nothing():
    rest = Turning(0.5, 0.0, 0.0, 0.5)
    assert forces(rest, rest, 0.8, 3000.0) == NO_ARM_FORCES


def test_lowering_a_raised_arm_in_a_left_turn_pushes_to_the_left():
    """The parts move ahead, and the turn carries what moves ahead to the outside: the ground has to push inwards."""
    found = forces(Turning(0.7, -0.5, 0.0, 0.0), Turning(0.0, 0.0, 0.0, 0.0), 0.8, 3000.0)
    assert found.y > 1e3
    mirrored = forces(Turning(0.7, -0.5, 0.0, 0.0), Turning(0.0, 0.0, 0.0, 0.0), -0.8, 3000.0)
    assert (mirrored.y, mirrored.rolling, mirrored.yawing) == pytest.approx(
        (-found.y, -found.rolling, -found.yawing)
    )
    assert mirrored[2:4] == pytest.approx(found[2:4])


def followed(angles, every=2, dt=0.01):
    """The tracked motion while a sensor samples `angles` every second cycle."""
    now = Turning(angles[0], 0.0, 0.0, angles[0])
    for k in range(1, len(angles)):
        now = tracked(now, angles[k - k % every], dt)
    return now


def test_an_even_motion_is_tracked_without_error():
    found = followed(0.4 * 0.01 * np.arange(200))
    assert found.rate == pytest.approx(0.4, rel=0.02)
    assert found.acceleration == pytest.approx(0.0, abs=0.05)


def test_an_even_acceleration_is_tracked_without_error():
    found = followed(0.5 * 1.0 * (0.01 * np.arange(100)) ** 2)
    assert found.acceleration == pytest.approx(1.0, rel=0.1)


def test_noise_of_the_sensor_is_no_motion():
    """0.03 deg of noise, rounded to 0.02 deg; after the first second."""
    random = np.random.default_rng(3)
    angles = np.round(np.radians(random.normal(0.0, 0.03, 3000)) / math.radians(0.02)) * math.radians(0.02)
    now, moved, accelerations = Turning(0.0, 0.0, 0.0, 0.0), 0, []
    for k in range(1, len(angles)):
        now = tracked(now, float(angles[k - k % 2]), 0.01)
        moved += moving(now)
        accelerations.append(now.acceleration)
    assert moved < 0.01 * len(angles)
    assert np.std(accelerations[100:]) < 0.15


EMPTY_BUCKET = BucketLoad(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
UP = Vector(0.0, 0.0, GRAVITY)


def standing(lift, tilt, tilt_pressure=2e6):
    """Inputs of a machine whose lift cylinders carry arm, bucket and the tilt cylinder's push, and nothing else."""
    i = Inputs(*([0.0] * len(Inputs._fields)))._replace(
        dt=0.01, pressure_usable=1.0, lift_arm_angle=lift, tilt_angle=tilt, tilt_pressure=tilt_pressure
    )
    low, high = (
        residual(i._replace(lift_pressure=pressure), 0.0, GRAVITY, P).weight for pressure in (0.0, 1e7)
    )
    return i._replace(lift_pressure=-low / (high - low) * 1e7)


def acceleration_of(i, load, part):
    """The lift arm's acceleration by the pressures of a machine at rest on the level."""
    return lift_acceleration(i, residual(i, UP.x, UP.z, P), UP, load, part, P)


@pytest.mark.parametrize("lift", [-0.5, 0.0, 0.5])
@pytest.mark.parametrize("acceleration", [-2.0, 0.0, 1.5])
def test_pressure_beyond_the_weight_turns_the_arm(lift, acceleration):
    """Virtual work: force times the cylinder's lever is the moment of inertia about the pivot times the acceleration."""
    i, rest = standing(lift, 0.0), Turning(lift, 0.0, 9.0, lift)
    inertia = ARM.mass * (ARM.along**2 + ARM.above**2) + ARM.pitch_inertia + BUCKET.mass * ARM.length**2
    lever = levers(lift, 0.0, ARM, BUCKET, P.cylinders, P.tilt_linkage).lift
    more = inertia * acceleration / (lever * P.cylinders.head_area)
    found = acceleration_of(i._replace(lift_pressure=i.lift_pressure + more), EMPTY_BUCKET, rest)
    assert found == pytest.approx(acceleration, rel=1e-6, abs=1e-6)


def test_in_a_pile_and_without_pressures_the_tracked_acceleration_stands_in():
    part = Turning(0.0, 0.3, 0.7, 0.0)
    i = standing(0.0, 0.0)
    assert acceleration_of(i, EMPTY_BUCKET._replace(digging=1.0), part) == 0.7
    assert acceleration_of(i._replace(pressure_usable=0.0), EMPTY_BUCKET, part) == 0.7
    assert acceleration_of(i._replace(tilt_pressure=0.0), EMPTY_BUCKET, part) == 0.7


def test_the_payload_stands_still_while_the_arm_accelerates():
    """The cylinders then carry inertia beside weight: 1 MPa more is no payload."""
    i = standing(0.0, 0.0)
    heavier = i._replace(lift_pressure=i.lift_pressure + 1e6)
    state = INITIAL._replace(cycles=100.0)
    even, uneven = Turning(0.0, 0.3, 0.0, 0.0), Turning(0.0, 0.3, 1.0, 0.0)
    moments = residual(heavier, UP.x, UP.z, P)
    assert followed_load(heavier, state, moments, UP, 0.0, 3.0, uneven, P).payload == 0.0
    assert followed_load(heavier, state, moments, UP, 0.0, 3.0, even, P).payload > 1.0


@pytest.mark.parametrize("every", [1, 2])
@pytest.mark.parametrize("ticks", range(1, MOST_TICKS + 1))
def test_a_wrong_angle_is_forgotten_however_long_a_cycle_takes(ticks, every):
    """Samples that still differ, by nothing that counts, are new ones."""
    now = Turning(0.1, 0.0, 0.0, 0.0)
    for k in range(400):
        now = tracked(now, 1e-9 * (k // every % 2), 0.01 * ticks)
    assert abs(now.angle) < 1e-6
    assert abs(now.rate) < 1e-6
    assert abs(now.acceleration) < 1e-4


def test_without_new_samples_the_motion_stays_possible():
    now = Turning(0.0, 0.0, 0.0, 0.0)
    for k in range(10):
        now = tracked(now, 0.1 * k * k, 0.01)
    sample = now.sample
    for _ in range(6000):
        now = tracked(now, sample, 0.01)
    assert abs(now.angle - sample) <= 0.5
    assert abs(now.rate) <= 3.0
