"""Standard deviations of loads, load-transfer ratio and payload, against the estimators' own equations."""

import math
import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ecu.calibration import load_calibration
from ecu.estimators.joint import joint_at
from ecu.estimators.loads import normal_force
from ecu.estimators.loads.doubt import Doubt
from ecu.estimators.loads.normal_force import Support
from ecu.estimators.loads.payload import standing_payload
from ecu.estimators.quantities import NormalForces, Vector
from ecu.estimators.signals import Inputs
from ecu.estimators.stability.rollover import load_transfer_ratio
from ecu.estimators.uncertainty import (
    ACCELERATION,
    ANGLE,
    OWN_FRONT,
    OWN_PAYLOAD,
    PRESSURE,
    STEERED,
    Spread,
    points_of,
    uncertainty,
    weighing,
    with_error,
)
from studies.campaigns.wrong_calibration import wrong_parameters
from tests.ecu.machine import STANDING

PARAMETERS = load_calibration().parameters
G = PARAMETERS.geometry
NOTHING = Spread(0.0, 0.0, 0.0, 0.0)
unhurried = settings(deadline=None)
angles = st.floats(-0.65, 0.65)


def loads(load, along, across, angle):
    """Wheel loads of a machine with this weight [N] and these moments about the joint [N m], by the estimators' balance."""
    return normal_force.normal_forces(
        Support(load, along / load, across / load), joint_at(angle), 0.0, 0.0, G
    )


@unhurried
@given(angles, st.floats(-3e3, 3e3), st.floats(-4e3, 4e3), st.floats(-4e3, 4e3), st.floats(-8e3, 8e3))
def test_an_error_moves_the_loads_as_the_balance_does(angle, more, along, across, shift):
    """Differences of the estimators' own loads; the loads are linear, the ratio nearly so."""
    before = loads(1e5, -2e4, shift, angle)
    after = loads(1e5 + more, -2e4 + along, shift + across, angle)
    v = with_error(NOTHING, more, along, across, points_of(angle, before, G))
    assert math.sqrt(v.left) == pytest.approx(abs(after.front_left - before.front_left), abs=1e-6)
    assert math.sqrt(v.right) == pytest.approx(abs(after.front_right - before.front_right), abs=1e-6)
    assert math.sqrt(v.rear) == pytest.approx(abs(after.rear_left - before.rear_left), abs=1e-6)
    small = with_error(NOTHING, more / 1e3, along / 1e3, across / 1e3, points_of(angle, before, G))
    nearly = loads(1e5 + more / 1e3, -2e4 + along / 1e3, shift + across / 1e3, angle)
    change = load_transfer_ratio(nearly) - load_transfer_ratio(before)
    assert math.sqrt(small.transfer) == pytest.approx(abs(change), rel=1e-3, abs=1e-9)


LEVEL = Vector(0.0, 0.0, 9.81)
STANDS = NormalForces(27e3, 27e3, 55e3, 31e3, 31e3)


SETTLED = Doubt(0.0, 0.0, 0.0, 3.2, 0.9)


def sure(angle=0.0, force=LEVEL, n=STANDS, payload=0.0, lift=-0.6, doubt=SETTLED, rate=0.0):
    return uncertainty(force, angle, rate, lift, payload, n, doubt, PARAMETERS)


@unhurried
@given(angles, st.floats(-4.0, 4.0))
def test_a_mirrored_machine_has_mirrored_uncertainties(angle, aside):
    one = sure(angle, Vector(0.5, aside, 9.7), NormalForces(20e3, 34e3, 55e3, 29e3, 33e3))
    other = sure(-angle, Vector(0.5, -aside, 9.7), NormalForces(34e3, 20e3, 55e3, 33e3, 29e3))
    assert one.normal_1 == pytest.approx(other.normal_2)
    assert one.normal_2 == pytest.approx(other.normal_1)
    assert one.load_transfer_ratio == pytest.approx(other.load_transfer_ratio)


@unhurried
@given(angles, st.floats(-5.0, 5.0), st.floats(-5.0, 5.0))
def test_nothing_is_surer_than_with_the_right_calibration(angle, ahead, aside):
    found = sure(angle, Vector(ahead, aside, 9.7))
    assert min(found[:4]) > OWN_FRONT
    assert found.payload > OWN_PAYLOAD


def test_a_hard_turn_makes_front_loads_less_sure():
    calm, hard = sure(), sure(0.5, Vector(0.0, 5.0, 9.81), NormalForces(5e3, 49e3, 55e3, 20e3, 42e3))
    assert hard.normal_1 > 1.1 * calm.normal_1
    assert hard.normal_2 > 1.1 * calm.normal_2


@pytest.mark.parametrize("lift_deg", [-37.0, 0.0, 40.0])
def test_wrong_calibrations_scatter_the_payload_as_is_said(lift_deg):
    """400 drawn calibrations weigh the same standing machine; pressures' scale and the estimate's own error are left out."""
    given_inputs = dict.fromkeys(Inputs._fields, 0.0) | STANDING | {"lift_arm_angle": math.radians(lift_deg)}
    i = Inputs(**{name: given_inputs[name] for name in Inputs._fields})
    draw = random.Random(1)
    weighed = [standing_payload(i, 9.81, wrong_parameters(PARAMETERS, draw)) for _ in range(400)]
    expected = weighing(i.lift_arm_angle, 0.0, 0.0, PARAMETERS).apart - OWN_PAYLOAD**2
    # the standard deviation of 400 is known to 3.5 %; places of arm and bucket also turn with the angle
    assert float(np.std(weighed)) == pytest.approx(math.sqrt(expected), rel=0.15)


@unhurried
@given(st.floats(-0.7, 0.7), st.floats(-0.5, 0.5), st.floats(0.0, 3500.0))
def test_scale_and_angle_move_the_payload_as_its_balance_does(lift, lean, payload):
    """The same moment of the cylinders, weighed with another scale of the pressures or another angle of the arm."""
    arm, bucket = PARAMETERS.arm, PARAMETERS.bucket

    def lever(along, above, angle):
        """Moment about the arm's pivot per newton of weight: place ahead less height times lean."""
        ahead, up = (
            along * math.cos(angle) - above * math.sin(angle),
            along * math.sin(angle) + above * math.cos(angle),
        )
        return ahead - up * lean

    own = arm.mass * lever(arm.along, arm.above, lift)
    moment = own + (bucket.mass + payload) * lever(arm.length, 0.0, lift)

    def weighed(scale=1.0, turned=0.0):
        # the arm's own weight is nearly all on its pin's line: its share follows the same angle
        return scale * moment / lever(arm.length, 0.0, lift + turned)

    small = 1e-5
    by_scale = (weighed(scale=1.0 + small) - weighed()) / small * PRESSURE
    by_angle = (weighed(turned=small) - weighed()) / small * ANGLE
    found = weighing(lift, payload, lean, PARAMETERS)
    assert math.sqrt(found.shared) == pytest.approx(math.hypot(by_scale, by_angle), rel=1e-3)


@unhurried
@given(angles, st.floats(-2e4, 2e4), st.floats(-5e4, 5e4))
def test_what_has_not_settled_widens_the_loads_that_it_moves(angle, load, pitching):
    """By the even distribution of one error, through the estimators' own balance."""
    c, s = math.cos(angle), math.sin(angle)
    calm, open_ = sure(angle), sure(angle, doubt=SETTLED._replace(load=load, pitching=pitching))
    before = loads(1e5, -2e4, 0.0, angle)
    after = loads(1e5 + load, -2e4 + pitching * c, pitching * s, angle)
    for k, wheel in enumerate(("front_left", "front_right", "rear_left", "rear_right")):
        moved = (getattr(after, wheel) - getattr(before, wheel)) / math.sqrt(3.0)
        assert open_[k] == pytest.approx(math.hypot(calm[k], moved), rel=1e-6)
    assert open_.payload == calm.payload


def test_a_payload_of_which_nothing_is_known_has_an_interval_that_holds_all_of_it():
    unsure = sure(doubt=SETTLED._replace(payload=3000.0)).payload
    assert 1.96 * unsure > 3000.0
    assert unsure == pytest.approx(math.hypot(sure().payload, 3000.0 / math.sqrt(3.0)))


def test_while_it_is_steered_the_ratio_and_the_rear_wheels_are_less_sure():
    calm, steered = sure(), sure(rate=-0.3)
    assert steered.load_transfer_ratio == pytest.approx(math.hypot(calm.load_transfer_ratio, 0.3 * STEERED))
    moved = (
        0.3
        * STEERED
        * sum((STANDS.front_left, STANDS.front_right, STANDS.rear_left, STANDS.rear_right))
        / 2.0
    )
    assert steered.normal_3 == pytest.approx(math.hypot(calm.normal_3, moved))
    assert steered.normal_1 == calm.normal_1


def test_a_wrong_zero_of_the_accelerometers_acts_on_the_load_too():
    """Moments about the ground: a load twice as high counts twice."""
    empty, low, high = sure(), sure(payload=3000.0), sure(payload=3000.0, doubt=SETTLED._replace(height=1.8))
    heavier = (PARAMETERS.bucket.mass + 3000.0) * 0.9 * ACCELERATION
    assert low.load_transfer_ratio > empty.load_transfer_ratio
    # the higher load's own moment beside all others, of which half act on the ratio as a moment about the track
    assert (
        high.load_transfer_ratio**2 - low.load_transfer_ratio**2
        > (2.0 * heavier / G.front_track / 1.2e5) ** 2
    )
