"""Doubt of payload and pile: nothing where all has settled, else what the machine's own equations make of the gap."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ecu.calibration import load_calibration
from ecu.estimators.loads.cog import front_unit_in, pose_at
from ecu.estimators.loads.doubt import doubt_of
from ecu.estimators.loads.payload import BucketLoad, loaded, push_of, pushed, residual
from ecu.estimators.motion.arm import Turning
from ecu.estimators.quantities import Vector
from ecu.estimators.signals import Inputs
from tests.ecu.machine import STANDING

P = load_calibration().parameters
STILL = Turning(STANDING["lift_arm_angle"], 0.0, 0.0, STANDING["lift_arm_angle"])
unhurried = settings(deadline=None, max_examples=50)


def inputs(**values):
    known = dict.fromkeys(Inputs._fields, 0.0) | STANDING | {"pressure_usable": 1.0} | values
    return Inputs(**{name: known[name] for name in Inputs._fields})


def doubt(i, load, along, lift=STILL):
    moments = residual(i, along.x, along.z, P)
    pose = pose_at(i.lift_arm_angle, i.tilt_angle, P.arm, P.bucket)
    return doubt_of(i, moments, along, load, push_of(i, load, P), lift, pose, P)


def carrying(payload, couple=0.0, **more):
    rest = {
        "calm_payload": payload,
        "calm_couple": couple,
        "digging": 0.0,
        "x": 0.0,
        "z": 0.0,
        "traction": 0.0,
    }
    return BucketLoad(payload=payload, couple=couple, **(rest | more))


pressures = st.floats(2e6, 2e7)
alongs = st.builds(Vector, st.floats(-5.0, 5.0), st.just(0.0), st.floats(8.0, 11.0))


@unhurried
@given(pressures, st.floats(2e5, 8e6), alongs)
def test_a_payload_that_has_settled_leaves_no_doubt(lift, tilt, along):
    i = inputs(lift_pressure=lift, tilt_pressure=tilt)
    payload, couple = loaded(i, residual(i, along.x, along.z, P), along.x, along.z, P)
    found = doubt(i, carrying(payload, couple), along)
    assert found[:3] == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


@unhurried
@given(pressures, st.floats(2e5, 8e6), alongs, st.floats(0.0, 3000.0), st.floats(-5e3, 5e3))
def test_a_payload_that_follows_moves_the_load_as_the_present_one_would(lift, tilt, along, payload, couple):
    """Weight and moment of the front unit, with what is followed and with what the pressures say now."""
    i = inputs(lift_pressure=lift, tilt_pressure=tilt)
    fresh, there = loaded(i, residual(i, along.x, along.z, P), along.x, along.z, P)
    pose = pose_at(i.lift_arm_angle, i.tilt_angle, P.arm, P.bucket)
    one, other = (front_unit_in(pose, mass, P.front, P.arm, P.bucket) for mass in (payload, fresh))

    def moment(body):
        return body.mass * (body.x * along.z - body.z * along.x)

    found = doubt(i, carrying(payload, couple), along)
    assert found.payload == pytest.approx(fresh - payload, abs=1e-6)
    assert found.load == pytest.approx((other.mass - one.mass) * along.z, abs=1e-3)
    assert found.pitching == pytest.approx(moment(other) - moment(one) + there - couple, rel=1e-6, abs=1e-2)


def digging(i, along, z=-2e4):
    """In a pile, with a push that is 1 kN behind what the pressures say."""
    load = carrying(300.0, digging=1.0, traction=3e4, z=z)
    x, z_now = pushed(i, residual(i, along.x, along.z, P), load.payload, load.couple, load.traction, along, P)
    return load._replace(x=x + 1e3), x, z_now


def test_a_push_that_follows_moves_the_load_as_the_present_one_would():
    """Weight on the wheels, and moment about the joint of a force at the cutting edge."""
    i, along = inputs(lift_pressure=1.5e7, tilt_pressure=5e6), Vector(0.5, 0.0, 9.8)
    load, x, z = digging(i, along)
    found, push = doubt(i, load, along), push_of(i, load, P)

    def pitching(x, z):
        return push.couple - push.ahead * z + push.height * x

    assert found.load == pytest.approx(-(z - load.z))
    assert found.pitching == pytest.approx(pitching(x, z) - pitching(load.x, load.z))


def test_what_is_dug_may_be_all_of_the_downward_force_or_none():
    i, along = inputs(lift_pressure=1.5e7, tilt_pressure=5e6), Vector(0.0, 0.0, 9.81)
    down, up = (doubt(i, digging(i, along, z)[0], along) for z in (-2e4, 2e4))
    assert down.payload == pytest.approx(2e4 / 9.81)
    assert up.payload == 0.0


def test_an_arm_that_accelerates_in_a_pile_leaves_its_own_moment_open():
    """The moment that turns arm, bucket and what it holds, as a force at the pin."""
    i, along = inputs(lift_pressure=1.5e7, tilt_pressure=5e6), Vector(0.0, 0.0, 9.81)
    load = digging(i, along)[0]
    calm = doubt(i, load, along)
    turning = doubt(i, load, along, STILL._replace(acceleration=0.3))
    mass = P.bucket.mass + load.payload + 2e4 / 9.81
    inertia = P.arm.pitch_inertia + P.arm.mass * P.arm.along**2 + mass * P.arm.length**2
    force = 0.3 * inertia / (P.arm.length * math.cos(i.lift_arm_angle))
    assert abs(turning.load) - abs(calm.load) == pytest.approx(force)


@pytest.mark.parametrize(
    ("changed", "lift"),
    [
        ({"pressure_usable": 0.0}, STILL),
        ({"tilt_pressure": 0.0}, STILL),
        ({}, STILL._replace(acceleration=2.0)),
    ],
)
def test_pressures_that_do_not_weigh_say_nothing_of_a_gap(changed, lift):
    """None, a cylinder that pulls, an arm that accelerates: the payload stands, and its standing error holds."""
    found = doubt(inputs(**changed), carrying(1500.0), Vector(0.0, 0.0, 9.81), lift)
    assert found[:3] == (0.0, 0.0, 0.0)
