"""How hard a speed limit brakes: no harder than the margins bear, and never harder than without the rule."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ecu.calibration import load_calibration
from ecu.estimators.loads.cog import front_unit
from ecu.estimators.quantities import Vector
from ecu.estimators.stability.levers import Levers
from ecu.estimators.stability.permitted_braking import (
    GENTLE,
    gentle,
    permitted_deceleration,
)
from ecu.estimators.stability.prediction import predict, with_acceleration
from ecu.estimators.stability.rollover import loaded_machine, steady_rate
from ecu.estimators.stability.steady import steady_forces, steady_turns
from ecu.estimators.stability.step import PredictionState

P = load_calibration().parameters
RULES = P.prediction
SLACK, FLOOR = RULES.braking_slack, RULES.margin_floor
G = 9.81
unhurried = settings(deadline=None, max_examples=40)  # the first example compiles
RAISED = loaded_machine(front_unit(0.54, 0.0, 3204.0, P.front, P.arm, P.bucket), 3204.0, P)
"""A full bucket, arm at 31 degrees."""


def rest(up, right_up):
    """What an accelerometer reads on a machine that stands nose up and right side up by small angles [rad]."""
    return Vector(
        G * math.sin(up),
        -G * math.sin(right_up),
        G * math.sqrt(1.0 - math.sin(up) ** 2 - math.sin(right_up) ** 2),
    )


def steady(speed, angle, ground, steering=0.0):
    """A turn at constant speed on this ground: drive torque holds the speed uphill. steering: articulation rate, also the demanded one."""
    turn = steady_rate(speed, angle, RAISED.wheel.lateral_peak, RAISED.geometry)
    forces = steady_forces(speed, turn, steady_turns(angle, ground.z, RAISED), ground, RAISED)
    return PredictionState(
        angle, steering, steering, speed, 0.0, *ground, ground, 0.0, turn, forces.front_left, forces.front_right,
        forces.rear_left + forces.rear_right, 0.0, 0.0, Levers(0.54, 0.0, 0.0, 0.0, 0.0, 0.0),
    )  # fmt: skip


UPHILL_RIGHT_TURN = steady(2.4, -0.36, rest(0.17, -0.115), steering=-0.38)
"""Drive 462 of seed 4 at 1.95 s: 16 % up, the outer, left side is the higher one by 7 degrees; the limit fell to 0 within 0.12 s."""
LEVEL_TURN = steady(2.4, -0.40, rest(0.0, 0.0))
DOWNHILL = steady(3.0, 0.0, rest(-0.1, 0.0))
"""Braking here lifts the rear of a machine with a full raised bucket."""


def braked(start, deceleration, hold=RULES.limit_hold):
    return predict(
        with_acceleration(start, -math.copysign(deceleration, start.speed)), hold, -1e9, RAISED
    ).margin


def mirrored(s):
    ground = Vector(s.ground.x, -s.ground.y, s.ground.z)
    return s._replace(
        articulation_angle=-s.articulation_angle, articulation_rate=-s.articulation_rate, demanded_rate=-s.demanded_rate, gravity_y=-s.gravity_y, ground=ground,
        yaw_rate=-s.yaw_rate, drift=-s.drift, front_left=s.front_right, front_right=s.front_left,
    )  # fmt: skip


def test_uphill_in_a_bend_braking_itself_would_tip_the_machine():
    """The drive keeps its margin at constant speed and loses it where the limit brakes: what the rule is for."""
    assert braked(UPHILL_RIGHT_TURN, 0.0) > FLOOR
    assert braked(UPHILL_RIGHT_TURN, 3.0) < 0.0


def test_uphill_in_a_bend_the_limit_follows_the_machine_down():
    start = UPHILL_RIGHT_TURN
    limit = gentle(0.0, start, RAISED)
    # what the machine then does: it brakes in proportion to what it is above its limit, and its weight pulls it back
    deceleration = (start.speed - limit) / SLACK + start.ground.x
    assert 0.0 <= deceleration < 3.0
    assert braked(start, deceleration) > FLOOR


def test_where_the_margins_bear_it_the_limit_is_left_as_it_is():
    assert gentle(0.0, LEVEL_TURN, RAISED) == 0.0


def test_downhill_a_raised_bucket_is_not_braked_onto_its_nose():
    assert braked(DOWNHILL, 3.0) < FLOOR
    limit = gentle(1.0, DOWNHILL, RAISED)
    assert 1.0 < limit < DOWNHILL.speed + SLACK * DOWNHILL.ground.x
    assert braked(DOWNHILL, (DOWNHILL.speed - limit) / SLACK + DOWNHILL.ground.x) > FLOOR


def test_a_limit_that_does_not_brake_is_left_as_it_is():
    start = UPHILL_RIGHT_TURN
    above = start.speed + SLACK * start.ground.x  # the drive torque that holds the machine is left to it
    assert gentle(above, start, RAISED) == above
    assert gentle(14.0, start, RAISED) == 14.0


def test_braking_that_keeps_the_floor_is_not_eased():
    assert braked(UPHILL_RIGHT_TURN, 2.0) > FLOOR
    assert permitted_deceleration(UPHILL_RIGHT_TURN, 2.0, RAISED) == 2.0
    assert permitted_deceleration(UPHILL_RIGHT_TURN, 3.0, RAISED) == 3.0 * GENTLE


def test_a_machine_at_its_limit_is_not_left_to_its_weight_uphill():
    """The limit takes the drive torque away; the slope alone then slows the machine down by more than the wheels bear."""
    start = steady(2.4, -0.42, rest(0.17, -0.21), steering=-0.38)
    assert braked(start, start.ground.x) < FLOOR
    assert gentle(start.speed, start, RAISED) > start.speed


@pytest.mark.parametrize(
    "start",
    [
        steady(6.2, 0.45, rest(0.0, 0.0)),  # too fast on the level: the hardest
        steady(2.4, -0.36, rest(0.17, -0.32), steering=-0.38),  # none on a steep bank
    ],
)
def test_where_no_braking_keeps_the_floor_the_least_harm_is_done(start):
    margins = {d: braked(start, d) for d in (3.0, 3.0 * GENTLE)}
    assert max(margins.values()) < FLOOR
    assert permitted_deceleration(start, 3.0, RAISED) == max(margins, key=lambda d: margins[d])


GROUNDS = st.builds(rest, st.floats(-0.2, 0.2), st.floats(-0.2, 0.2))
STATES = st.builds(steady, st.floats(-6.0, 6.0), st.floats(-0.6, 0.6), GROUNDS)


@given(start=STATES, limit=st.floats(0.0, 14.0))
@unhurried
def test_a_limit_is_only_raised_and_never_above_what_keeps_the_speed(start, limit):
    found = gentle(limit, start, RAISED)
    forward = 1.0 if start.speed >= 0.0 else -1.0
    assert limit <= found <= max(limit, abs(start.speed) + SLACK * max(forward * start.ground.x, 0.0))


@given(start=STATES, limit=st.floats(0.0, 6.0))
@unhurried
def test_a_limit_is_the_same_in_the_mirror(start, limit):
    assert gentle(limit, mirrored(start), RAISED) == pytest.approx(gentle(limit, start, RAISED), abs=1e-9)


def test_in_reverse_braking_pushes_the_other_way():
    """Backing down the same slope, the machine decelerates uphill too: its acceleration along the rear frame is then positive."""
    back = steady(-2.4, -0.40, rest(0.17, -0.115))
    assert braked(back, 2.0) == predict(with_acceleration(back, 2.0), RULES.limit_hold, -1e9, RAISED).margin
    assert permitted_deceleration(back, 2.0, RAISED) == 2.0
