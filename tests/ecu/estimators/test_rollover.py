"""Laws of the load-transfer ratio, the margin and their prediction: signs, mirror, limits, monotony, units.

Independent references: the roll balance of the whole machine about the ground, and the support triangle whose edges
are the lift-off lines.
"""

import itertools
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ecu.calibration import load_calibration
from ecu.estimators.joint import joint_at
from ecu.estimators.loads.cog import front_unit
from ecu.estimators.loads.normal_force import Support, normal_forces
from ecu.estimators.motion.acceleration import yaw_rate
from ecu.estimators.parameters import GRAVITY, Body
from ecu.estimators.quantities import NormalForces, Vector
from ecu.estimators.signals import NEVER
from ecu.estimators.stability.levers import Levers
from ecu.estimators.stability.prediction import predict, with_demand
from ecu.estimators.stability.rollover import (
    front_load_transfer_ratio,
    load_transfer_ratio,
    loaded_machine,
    margin,
    steady_loads,
)
from ecu.estimators.stability.start import felt
from ecu.estimators.stability.step import PredictionState

unhurried = settings(deadline=None, max_examples=40)  # the first example compiles
P = load_calibration().parameters
LEVEL = Vector(0.0, 0.0, GRAVITY)
LOW, HIGH = -0.65, 0.7  # lift arm carried low, and raised [rad]
HOLD = 1.2
CALM = P._replace(prediction=P.prediction._replace(roll_damping=1.0))
newtons = st.floats(1.0, 1e5)
wheels = st.builds(NormalForces, newtons, newtons, newtons, newtons, newtons)


def machine(payload=0.0, arm=LOW, parameters=P):
    return loaded_machine(
        front_unit(arm, 0.82 if arm == LOW else 0.0, payload, parameters.front, parameters.arm, parameters.bucket),
        payload, parameters,
    )  # fmt: skip


EMPTY, RAISED = machine(), machine(2000.0, HIGH)


def turning(speed, angle, given=EMPTY, gravity=LEVEL):
    """Normal forces of a steady turn."""
    loads = steady_loads(
        speed, angle, gravity, P.wheel.lateral_peak, given.front, given.rear, given.axle, given.geometry
    )
    return normal_forces(loads.support, joint_at(angle), loads.axle_load, loads.axle_moment, given.geometry)


def start(speed, angle, given=EMPTY, gravity=LEVEL, rate=0.0):
    """A machine in a steady turn without side slip, articulating at `rate`."""
    n = turning(speed, angle, given, gravity)
    yaw = yaw_rate(speed, angle, rate, P.geometry)
    return PredictionState(
        articulation_angle=angle,
        articulation_rate=rate,
        demanded_rate=rate,
        speed=speed,
        acceleration=0.0,
        gravity_x=gravity.x,
        gravity_y=gravity.y,
        gravity_z=gravity.z,
        ground=gravity,
        drift=P.geometry.rear_length * yaw,
        yaw_rate=yaw,
        front_left=n.front_left,
        front_right=n.front_right,
        rear_load=n.rear_left + n.rear_right,
        left_rate=0.0,
        right_rate=0.0,
        levers=Levers(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    )


def mirrored_forces(n):
    return NormalForces(n.front_right, n.front_left, n.pivot, n.rear_right, n.rear_left)


# load-transfer ratio and margin of given loads


@given(wheels)
def test_the_ratio_changes_sign_in_the_mirror(n):
    assert load_transfer_ratio(mirrored_forces(n)) == pytest.approx(-load_transfer_ratio(n), abs=1e-15)


@given(wheels)
def test_the_ratio_stays_within_one_while_all_wheels_stand(n):
    assert -1.0 < load_transfer_ratio(n) < 1.0


@given(newtons, newtons)
def test_the_ratio_is_one_when_the_left_wheels_have_lifted(front, rear):
    right_only = NormalForces(0.0, front, 0.0, 0.0, rear)
    assert load_transfer_ratio(right_only) == 1.0
    assert load_transfer_ratio(mirrored_forces(right_only)) == -1.0
    # where the wheels carry nothing together, or pull, a share of it means nothing
    assert load_transfer_ratio(NormalForces(1e14, -1e14, 0.0, 5.0, -5.0)) == 0.0
    assert load_transfer_ratio(NormalForces(-2e4, -1e4, -3e4, 0.0, 0.0)) == 0.0


@given(wheels)
def test_the_ratio_of_the_front_pair_is_mirrored_and_does_not_see_the_rear_pair(n):
    ratio = front_load_transfer_ratio(n)
    assert -1.0 < ratio < 1.0
    assert front_load_transfer_ratio(mirrored_forces(n)) == -ratio
    assert front_load_transfer_ratio(n._replace(rear_left=0.0, rear_right=9e4)) == ratio


@given(st.floats(-0.6, 0.6), st.floats(1e4, 2e5), st.floats(-0.5, 0.5), st.booleans())
def test_the_ratio_of_the_front_pair_is_one_on_the_edges_of_the_support_triangle(angle, load, x, left):
    """EQUATIONS 2.5: the front left wheel is unloaded on the line from pivot to right contact, and the other way round."""
    g = P.geometry
    c, s, half, lf, lr = math.cos(angle), math.sin(angle), g.front_track / 2, g.front_length, g.rear_length
    if left:
        y = -(x + lr) * (half * c - lf * s) / (lf * c + lr + half * s)
    else:
        y = (x + lr) * (half * c + lf * s) / (lf * c + lr - half * s)
    n = normal_forces(Support(load, x, y), joint_at(angle), 2e4, 0.0, g)
    assert front_load_transfer_ratio(n) == pytest.approx(1.0 if left else -1.0, abs=1e-9)


def test_the_front_pair_reaches_one_before_the_four_wheels_do():
    n = NormalForces(0.0, 5e4, 4e4, 2e4, 3e4)
    assert front_load_transfer_ratio(n) == 1.0
    assert 0.0 < load_transfer_ratio(n) < 1.0


@given(newtons)
def test_a_pull_on_a_front_wheel_counts_as_no_load(pull):
    assert front_load_transfer_ratio(NormalForces(-pull, 5e4, 4e4, 2e4, 3e4)) == 1.0
    assert front_load_transfer_ratio(NormalForces(-pull, -pull, 4e4, 2e4, 3e4)) == 0.0


@given(wheels, st.floats(1e-3, 1e3))
def test_ratio_and_margin_do_not_depend_on_the_unit_of_force(n, factor):
    scaled = NormalForces(*(factor * force for force in n))
    assert load_transfer_ratio(scaled) == pytest.approx(load_transfer_ratio(n), abs=1e-12)
    standing = NormalForces(3e4, 3e4, 6e4, 2e4, 2e4)
    both = margin(scaled, NormalForces(*(factor * force for force in standing)))
    assert both.ratio == pytest.approx(margin(n, standing).ratio, rel=1e-12)


@pytest.mark.parametrize("lifted", [1, 2, 3, 4])
def test_the_margin_is_zero_at_lift_off_and_names_the_wheel(lifted):
    standing = NormalForces(3e4, 3.1e4, 6e4, 2e4, 2.2e4)
    loads = list(standing)
    loads[{1: 0, 2: 1, 3: 3, 4: 4}[lifted]] = 0.0
    assert margin(NormalForces(*loads), standing) == (0.0, float(lifted))


def test_the_margin_is_that_of_the_wheel_nearest_to_lift_off():
    standing = NormalForces(4e4, 4e4, 6e4, 2e4, 2e4)
    assert margin(NormalForces(1e4, 4e4, 6e4, 0.9e4, 2e4), standing) == (0.25, 1.0)


@given(st.floats(-0.7, 0.7), st.floats(-1.2, 1.2))
def test_a_front_wheel_lifts_on_the_edge_of_the_support_triangle(angle, forward):
    """N1 = 0 where Y' = -(X' + l_r) (t/2 cos d - l_f sin d) / (l_f cos d + l_r + t/2 sin d)."""
    g = P.geometry
    half, c, s = g.front_track / 2.0, math.cos(angle), math.sin(angle)
    edge = (half * c - g.front_length * s) / (g.front_length * c + g.rear_length + half * s)
    across = -(forward + g.rear_length) * edge
    n = normal_forces(Support(1e5, forward, across), joint_at(angle), 1e4, 0.0, g)
    assert n.front_left == pytest.approx(0.0, abs=1e-8 * 1e5)
    assert normal_forces(Support(1e5, forward, across + 0.01), joint_at(angle), 1e4, 0.0, g).front_left > 0.0


# steady turns


def test_a_straight_machine_at_rest_on_the_level_is_symmetric():
    n = turning(0.0, 0.0)
    assert load_transfer_ratio(n) == pytest.approx(0.0, abs=1e-15)
    assert margin(n, EMPTY.standing).ratio == pytest.approx(1.0)


@unhurried
@given(st.floats(0.0, 10.0), st.floats(-0.6, 0.6))
def test_left_and_right_turns_are_mirrored(speed, angle):
    left, right = turning(speed, angle), turning(speed, -angle)
    assert left == pytest.approx(mirrored_forces(right), rel=1e-9, abs=1e-6)


@pytest.mark.parametrize("given", [EMPTY, RAISED])
@pytest.mark.parametrize("speed", [-6.0, 6.0])
def test_a_left_turn_loads_the_right_side(speed, given):
    """Forward and in reverse: the acceleration points to the centre of the turn."""
    assert (
        load_transfer_ratio(turning(speed, 0.3, given))
        > 0.0
        > load_transfer_ratio(turning(speed, -0.3, given))
    )


@unhurried
@given(st.floats(-0.2, 0.2), st.sampled_from([EMPTY, RAISED]))
def test_on_a_bank_the_ratio_follows_the_whole_machines_roll_balance(bank, given):
    """Straight, right side up: the right wheels carry less by twice the sum of m h f_y over the track (tracks equal)."""
    fy, fz = -GRAVITY * math.sin(bank), GRAVITY * math.cos(bank)
    moment = (
        given.front.mass * given.front.z
        + given.rear.mass * given.rear.z
        + given.axle.mass * given.axle.height
    )
    mass = given.front.mass + given.rear.mass + given.axle.mass
    expected = 2.0 * moment * fy / (P.geometry.front_track * mass * fz)
    n = turning(0.0, 0.0, given, Vector(0.0, fy, fz))
    assert P.geometry.front_track == P.geometry.rear_track
    assert load_transfer_ratio(n) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def ratios(cases):
    return [load_transfer_ratio(turning(*case)) for case in cases]


def margins(cases):
    return [margin(turning(*case), case[2].standing).ratio for case in cases]


RISING = {
    "speed": [(v, 0.4, EMPTY) for v in (0.0, 1.5, 3.0, 4.0, 5.0)],
    "articulation": [(4.0, d, EMPTY) for d in (0.0, 0.1, 0.2, 0.35, 0.5)],
    "payload height": [(4.0, 0.3, machine(2000.0, arm)) for arm in (-0.6, -0.3, 0.0, 0.3, 0.7)],
}


@pytest.mark.parametrize("cases", RISING.values(), ids=RISING)
def test_load_transfer_rises_and_the_margin_falls_with(cases):
    found = ratios(cases)
    assert found == sorted(found)
    assert found[-1] > found[0] + 0.02
    if len({case[2] for case in cases}) == 1:
        assert margins(cases) == sorted(margins(cases), reverse=True)


# prediction


def test_a_straight_machine_at_rest_stays_as_it_is():
    found = predict(start(0.0, 0.0), HOLD, 0.0, EMPTY)
    assert found.time_to_lift_off == NEVER
    assert found.margin == pytest.approx(1.0)
    assert found.load_transfer_ratio == pytest.approx(0.0, abs=1e-12)


@unhurried
@given(st.floats(0.5, 8.0), st.floats(-0.5, 0.5), st.floats(-0.6, 0.6))
def test_the_prediction_is_mirrored(speed, angle, rate):
    left = predict(start(speed, angle, RAISED, rate=rate), HOLD, 0.0, RAISED)
    right = predict(start(speed, -angle, RAISED, rate=-rate), HOLD, 0.0, RAISED)
    assert left.time_to_lift_off == right.time_to_lift_off
    assert left.margin == pytest.approx(right.margin, abs=1e-6)
    assert left.load_transfer_ratio == pytest.approx(-right.load_transfer_ratio, abs=1e-6)
    if abs(left.load_transfer_ratio) > 1e-3:  # else both sides are as near to lift-off
        assert {1.0: 2.0, 2.0: 1.0, 3.0: 4.0, 4.0: 3.0}[left.wheel] == right.wheel


@pytest.mark.parametrize("angle", [-0.3, 0.2, 0.35])
def test_a_slow_steady_turn_is_predicted_to_go_on(angle):
    """At 2 m/s tyres hardly slip: the prediction stays at the steady turn's ratio."""
    found = predict(start(2.0, angle), 0.0, 0.0, EMPTY)
    expected = load_transfer_ratio(turning(2.0, angle))
    assert found.load_transfer_ratio == pytest.approx(expected, rel=0.05)
    assert found.time_to_lift_off == NEVER


@unhurried
@given(st.floats(1.0, 9.0), st.floats(-0.5, 0.5), st.floats(-0.7, 0.7), st.sampled_from([0.0, 0.3]))
def test_a_time_to_lift_off_is_given_exactly_when_the_margin_is_used_up(speed, angle, rate, floor):
    found = predict(start(speed, angle, RAISED, rate=rate), HOLD, floor, RAISED)
    assert (found.time_to_lift_off < NEVER) == (found.margin <= 0.0)
    assert found.time_to_lift_off == NEVER or 0.0 <= found.time_to_lift_off <= P.prediction.horizon


PREDICTED = {
    "speed": [(v, 0.2, RAISED, 0.5) for v in (1.0, 2.0, 3.0, 4.0, 5.0)],
    "articulation": [(3.5, d, RAISED, 0.3) for d in (0.0, 0.1, 0.2, 0.3)],
    "articulation rate": [(3.5, 0.1, RAISED, r) for r in (0.0, 0.15, 0.3, 0.5)],
    # critically damped: else the phase of the roll at the end of the horizon differs with the height
    "payload height": [(4.0, 0.2, machine(2000.0, arm, CALM), 0.3) for arm in (-0.6, -0.3, 0.0, 0.3, 0.7)],
}


def predicted(cases):
    return [
        predict(start(speed, angle, given, rate=rate), HOLD, -9.0, given)
        for speed, angle, given, rate in cases
    ]


@pytest.mark.parametrize("cases", PREDICTED.values(), ids=PREDICTED)
def test_the_predicted_ratio_rises_with(cases):
    found = [each.load_transfer_ratio for each in predicted(cases)]
    assert found == sorted(found)
    assert found[-1] > found[0] + 0.02


@pytest.mark.parametrize("name", ["speed", "articulation", "articulation rate"])
def test_the_predicted_margin_falls_with(name):
    found = [each.margin for each in predicted(PREDICTED[name])]
    assert found == sorted(found, reverse=True)
    assert found[-1] < found[0] - 0.02


def test_lift_off_comes_sooner_at_a_higher_speed():
    times = [
        predict(start(v, 0.3, RAISED, rate=0.6), HOLD, 0.0, RAISED).time_to_lift_off for v in (5.0, 6.0, 8.0)
    ]
    assert times == sorted(times, reverse=True)
    assert times[-1] < times[0] < NEVER


def test_in_a_left_turn_the_front_left_wheel_lifts_first():
    found = predict(start(7.0, 0.3, RAISED, rate=0.6), HOLD, 0.0, RAISED)
    assert found.wheel == 1.0
    assert found.load_transfer_ratio > 0.0


def test_it_is_the_demand_that_is_predicted():
    """From a straight line a demand to the right loads the left side."""
    still = start(5.0, 0.0)
    assert predict(with_demand(still, -0.6), HOLD, 0.0, EMPTY).load_transfer_ratio < -0.05
    assert predict(with_demand(still, 0.6), HOLD, 0.0, EMPTY).load_transfer_ratio > 0.05


def test_the_prediction_does_not_depend_on_the_unit_of_mass():
    """In tonnes instead of kilograms, with stiffnesses to match: the same ratios and times."""

    def tonnes(body: Body) -> Body:
        return Body(body.mass / 1e3, body.x, body.z, *(inertia / 1e3 for inertia in body[3:]))

    rules = P.prediction._replace(tyre_stiffness=P.prediction.tyre_stiffness / 1e3)
    front = tonnes(RAISED.front)
    axle = P.axle._replace(mass=P.axle.mass / 1e3, roll_inertia=P.axle.roll_inertia / 1e3)
    light = loaded_machine(front, 2.0, P._replace(rear=tonnes(P.rear), axle=axle, prediction=rules))
    begin = start(4.0, 0.2, RAISED, rate=0.4)
    kilograms = predict(begin, HOLD, -9.0, RAISED)
    scaled = begin._replace(
        front_left=begin.front_left / 1e3,
        front_right=begin.front_right / 1e3,
        rear_load=begin.rear_load / 1e3,
    )
    assert predict(scaled, HOLD, -9.0, light) == pytest.approx(kilograms, rel=1e-9)


def test_a_finer_step_changes_the_prediction_less_and_less():
    """First order in the step; the step in use is 0.07 of margin from the limit."""
    steps = (P.prediction.step / n for n in (1, 2, 4, 8))
    machines = [machine(2000.0, HIGH, P._replace(prediction=P.prediction._replace(step=s))) for s in steps]
    found = [predict(start(4.0, 0.2, each, rate=0.4), HOLD, -9.0, each).margin for each in machines]
    gaps = [abs(b - a) for a, b in itertools.pairwise(found)]
    assert gaps == sorted(gaps, reverse=True)
    assert abs(found[0] - found[-1]) < 0.07


@pytest.mark.parametrize("angle", [-0.4, 0.4])
def test_a_turn_begun_uphill_takes_load_off_its_outer_side(angle):
    """Uphill, a left turn brings the right side up, so that its wheels carry less than on the level; downhill more."""
    ratios = []
    for slope in (-0.15, 0.0, 0.15):
        gravity = Vector(GRAVITY * math.sin(slope), 0.0, GRAVITY * math.cos(slope))
        found = predict(start(3.0, angle, EMPTY, gravity), 0.0, -9.0, EMPTY)
        ratios.append(math.copysign(1.0, angle) * found.load_transfer_ratio)
    assert ratios == sorted(ratios, reverse=True)
    assert ratios[0] > ratios[2] + 0.02


# where inputs contradict one another

WILD = {
    "articulation_rate": 2.0, "demanded_rate": 2.0, "speed": 30.0, "acceleration": 400.0, "gravity_x": 400.0, "gravity_y": 400.0,
    "gravity_z": 400.0, "drift": 1e3, "yaw_rate": 5.0, "front_left": 1e7, "front_right": 1e7, "rear_load": 1e7,
    "left_rate": 1e9, "right_rate": 1e9,
}  # fmt: skip
wild_starts = st.builds(
    lambda angle, levers, values: start(0.0, angle)._replace(levers=Levers(*levers), **values),
    st.floats(-0.7, 0.7),
    st.tuples(*[st.floats(-3.0, 3.0)] * 6),
    st.fixed_dictionaries({name: st.floats(-most, most) for name, most in WILD.items()}),
)


@given(wild_starts, st.sampled_from([0.0, 0.3, -1e9]))
@settings(deadline=None, max_examples=200)
def test_a_prediction_from_any_start_ends_where_the_machine_has_overturned(begin, floor):
    found = predict(begin, 0.5, floor, EMPTY)
    assert found.margin >= -10.0
    assert abs(found.load_transfer_ratio) <= 10.0
    assert found.wheel in (1.0, 2.0, 3.0, 4.0)


@given(st.tuples(*[st.floats(-400.0, 400.0)] * 3))
def test_a_force_that_nobody_can_feel_keeps_its_direction_alone(values):
    force, size = felt(Vector(*values)), math.hypot(*values)
    assert math.hypot(*force) == pytest.approx(min(size, 2.0 * 9.81), rel=1e-12)
    assert [size * x for x in force] == pytest.approx(
        [math.hypot(*force) * x for x in values], rel=1e-9, abs=1e-9
    )


def test_a_machine_whose_arm_carries_it_stands_nowhere():
    """Without a load there is no support point: the moments are divided by a share of the weight, and not by zero."""
    weightless = Vector(0.5, 0.5, 0.0)
    n = turning(1.0, 0.2, EMPTY, weightless)
    assert all(math.isfinite(force) for force in n)
