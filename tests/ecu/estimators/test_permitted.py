"""Permitted rate and speed: what they lead to, on the level and on slopes."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dbc import loader_database
from ecu.calibration import load_calibration
from ecu.estimators.loads.cog import front_unit
from ecu.estimators.quantities import Vector
from ecu.estimators.stability.levers import Levers
from ecu.estimators.stability.permitted import (
    NONE,
    SPEED_STEP,
    TRANSIENT,
    keeps_margins,
    leads_out,
    limit_for,
    margin_after,
    permitted_rate,
    permitted_speed,
)
from ecu.estimators.stability.prediction import predict, with_demand
from ecu.estimators.stability.rollover import loaded_machine, steady_rate
from ecu.estimators.stability.steady import least_margin, steady_forces, steady_turns, turned_gravity
from ecu.estimators.stability.step import PredictionState

P = load_calibration().parameters
G, LOCK = 9.81, 0.66
LEVEL = Vector(0.0, 0.0, G)
unhurried = settings(deadline=None, max_examples=60)  # the first example compiles


def machine(**prediction):
    """The empty machine with the bucket carried, other numbers of its prediction."""
    given = P._replace(prediction=P.prediction._replace(**prediction))
    return loaded_machine(front_unit(-0.65, 0.82, 0.0, P.front, P.arm, P.bucket), 0.0, given)


MACHINE = machine()


def stays_above(floor, speed, turns, ground, m):
    """Whether a turn begun at this speed keeps the floor while the machine slows down."""
    return least_margin(floor, speed, turns, ground, m) >= floor


def uphill(angle):
    """What an accelerometer reads on a machine that stands nose up by `angle`."""
    return Vector(G * math.sin(angle), 0.0, G * math.cos(angle))


@pytest.mark.parametrize("braking", [0.0, 1.0, 5.0])
def test_on_the_level_only_the_beginning_of_a_turn_counts(braking):
    now = permitted_speed(LOCK, LEVEL, 1.0, machine(braking=braking, turn_ahead=0.0))
    assert permitted_speed(LOCK, LEVEL, 1.0, machine(braking=braking, turn_ahead=4.0)) == now


def test_driving_straight_only_the_present_heading_counts():
    slope = turned_gravity(uphill(0.15), 0.7)
    now = permitted_speed(0.0, slope, 1.0, machine(turn_ahead=0.0))
    assert permitted_speed(0.0, slope, 1.0, MACHINE) == now


def test_at_the_permitted_speed_the_floor_is_just_kept():
    slope = turned_gravity(uphill(0.15), 1.0)
    speed, floor = permitted_speed(LOCK, slope, 1.0, MACHINE), P.prediction.speed_floor
    turns = steady_turns(LOCK, slope.z, MACHINE)
    assert stays_above(floor, 0.99 * speed, turns, slope, MACHINE)
    assert not stays_above(floor, 1.02 * speed, turns, slope, MACHINE)


def test_a_turn_that_will_point_its_outer_side_downhill_has_to_be_begun_slower():
    """A left turn with the right side up: half a turn later its outer, right side is the lower one."""
    right_up = turned_gravity(uphill(0.15), math.pi / 2)
    far, near = (permitted_speed(LOCK, right_up, 1.0, machine(turn_ahead=t)) for t in (6.0, 0.0))
    worst = permitted_speed(LOCK, turned_gravity(right_up, math.pi), 1.0, machine(turn_ahead=0.0))
    assert worst < 0.9 * near
    assert far < 0.9 * near


def test_brakes_let_a_turn_on_a_slope_begin_faster():
    """Right side up: by the time the outer side is the lower one, the machine has slowed down."""
    right_up = turned_gravity(uphill(0.15), math.pi / 2)
    found = [permitted_speed(LOCK, right_up, 1.0, machine(braking=a)) for a in (0.0, 1.0, 3.0)]
    assert found == sorted(found)
    assert found[0] < 0.95 * found[2]


def test_what_pushes_downhill_comes_off_the_brakes():
    """Nose down the slope pushes with 1.4 m/s²: brakes of 0.5 m/s² are as none, those of 3 m/s² slow the machine down."""
    found = [
        permitted_speed(0.3, uphill(-0.15), 1.0, machine(braking=a, turn_ahead=1.5)) for a in (0.0, 0.5, 3.0)
    ]
    assert found[0] == found[1] < found[2]


def test_forward_to_the_left_and_mirrored_to_the_right_are_alike():
    right_up = turned_gravity(uphill(0.15), 1.1)
    mirrored = Vector(right_up.x, -right_up.y, right_up.z)
    left = permitted_speed(LOCK, right_up, 1.0, MACHINE)
    assert permitted_speed(-LOCK, mirrored, 1.0, MACHINE) == pytest.approx(left, rel=1e-9)


def start(speed, angle, demanded, ground, m=MACHINE):
    """A steady turn on this ground in which another articulation rate is demanded."""
    turn = steady_rate(speed, angle, m.wheel.lateral_peak, m.geometry)
    forces = steady_forces(speed, turn, steady_turns(angle, ground.z, m), ground, m)
    rear = forces.rear_left + forces.rear_right
    return PredictionState(
        angle, 0.0, demanded, speed, 0.0, *ground, ground, 0.0, turn, forces.front_left, forces.front_right, rear, 0.0, 0.0,
        Levers(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    )  # fmt: skip


@pytest.mark.parametrize("ground", [LEVEL, turned_gravity(uphill(0.15), math.pi / 2)])
def test_at_the_permitted_rate_both_margins_are_just_kept(ground):
    now = start(6.0, 0.2, 0.5, ground)
    rate, step = permitted_rate(now, MACHINE), P.prediction.largest_rate / 64.0
    assert 0.0 < rate < P.prediction.largest_rate
    assert keeps_margins(now, rate, MACHINE)
    assert not keeps_margins(now, rate + step, MACHINE)
    angle = 0.2 + rate * P.prediction.limit_hold
    turns = steady_turns(angle, ground.z, MACHINE)
    assert stays_above(P.prediction.turn_floor, 6.0, turns, ground, MACHINE)


def test_the_turn_that_follows_binds_the_rate_before_the_horizon_does():
    """Right side up in a left turn: what lies beyond the horizon is the worse heading."""
    right_up = turned_gravity(uphill(0.15), math.pi / 2)
    rates = [
        permitted_rate(start(6.0, 0.1, 0.5, right_up), machine(turn_floor=floor))
        for floor in (-9.0, P.prediction.turn_floor)
    ]
    assert 0.0 < rates[1] < 0.8 * rates[0]


def test_rates_to_either_side_are_mirrored():
    slope = turned_gravity(uphill(0.12), 1.2)
    mirrored = Vector(slope.x, -slope.y, slope.z)
    left = permitted_rate(start(6.0, 0.2, 0.5, slope), MACHINE)
    assert 0.0 < left < P.prediction.largest_rate
    assert permitted_rate(start(6.0, -0.2, -0.5, mirrored), MACHINE) == pytest.approx(left, rel=1e-9)


def test_the_limit_is_lowered_by_what_pushes_downhill_and_by_nothing_else():
    slack = P.prediction.braking_slack
    assert limit_for(5.0, uphill(-0.15), 1.0, MACHINE) == pytest.approx(5.0 - slack * G * math.sin(0.15))
    assert limit_for(5.0, uphill(0.15), -1.0, MACHINE) == pytest.approx(5.0 - slack * G * math.sin(0.15))
    assert limit_for(5.0, uphill(0.15), 1.0, MACHINE) == 5.0
    assert limit_for(5.0, LEVEL, 1.0, MACHINE) == 5.0
    assert limit_for(0.1, uphill(-0.15), 1.0, MACHINE) == 0.0
    most = P.prediction.largest_speed
    assert limit_for(most, uphill(-0.15), 1.0, MACHINE) == most


def raised(payload, arm=0.7):
    """The machine with its arm up."""
    return loaded_machine(front_unit(arm, 0.0, payload, P.front, P.arm, P.bucket), payload, P)


def on_bank(angle):
    """What an accelerometer reads on a bank, right side up by `angle`."""
    return Vector(0.0, -G * math.sin(angle), G * math.cos(angle))


ABOUT_TO_TIP = [
    (3.0, -0.52, on_bank(0.26)),  # a right turn on a bank of 15 deg: the outer, left side is the lower one
    (7.0, -0.4, LEVEL),
    (-5.5, -0.52, LEVEL),  # reverse
]


@pytest.mark.parametrize(("speed", "angle", "ground"), ABOUT_TO_TIP)
def test_where_holding_the_angle_is_too_much_turning_back_is_permitted_and_turning_on_is_not(
    speed, angle, ground
):
    m = raised(1600.0)
    back, on = (start(speed, angle, demand, ground, m) for demand in (0.5, -0.5))
    assert not keeps_margins(back, 0.0, m)
    assert permitted_rate(back, m) >= P.prediction.largest_rate / 8.0
    assert permitted_rate(on, m) == 0.0


@pytest.mark.parametrize(("speed", "angle", "ground"), ABOUT_TO_TIP)
def test_the_rate_that_is_permitted_for_recovery_is_mirrored(speed, angle, ground):
    m, mirrored = raised(1600.0), Vector(ground.x, -ground.y, ground.z)
    right, left = start(speed, angle, 0.5, ground, m), start(speed, -angle, -0.5, mirrored, m)
    assert permitted_rate(left, m) == permitted_rate(right, m)


@pytest.mark.parametrize("demand", [0.5, -0.5])
def test_a_rate_for_recovery_leaves_a_better_turn_behind(demand):
    m = raised(1600.0)
    now = start(7.0, -0.4, demand, LEVEL, m)
    rate = permitted_rate(now, m)
    back, here = (margin_after(NONE, now, math.copysign(r, demand), m) for r in (rate, 0.0))
    assert (rate == 0.0) if demand < 0.0 else (back > here)


def test_the_speed_is_known_to_a_raw_step_of_its_signal():
    signal = loader_database().by_name["Limits"].by_signal["Speed"]
    assert pytest.approx(signal.scale) == 3.6 * SPEED_STEP


def bisected(keeps, most):
    """The largest value that keeps, to a thousandth of `most` over the ten halvings after; as the limits were found before."""
    low, high = 0.0, most
    for _ in range(14):
        trial = (low + high) / 2.0
        low, high = (trial, high) if keeps(trial) else (low, trial)
    return low


SPEEDS, ANGLES = st.floats(-6.0, 10.0), st.floats(-0.6, 0.6)
GROUNDS = st.builds(
    lambda grade, heading: turned_gravity(uphill(grade), heading), st.floats(0.0, 0.2), st.floats(-3.1, 3.1)
)


@unhurried
@given(SPEEDS, ANGLES, GROUNDS, st.sampled_from((0.5, -0.5)))
def test_a_permitted_rate_keeps_both_margins_and_is_not_above_the_bisected_one(speed, angle, ground, demand):
    now, side = start(speed, angle, demand, ground), math.copysign(1.0, demand)
    rate = permitted_rate(now, MACHINE)
    if not keeps_margins(now, 0.0, MACHINE):
        return  # recovery has laws of its own
    assert keeps_margins(now, side * rate, MACHINE)
    if rate < P.prediction.largest_rate:
        found = bisected(lambda r: keeps_margins(now, side * r, MACHINE), P.prediction.largest_rate)
        assert found - P.prediction.largest_rate / 64.0 <= rate <= found


@unhurried
@given(ANGLES, GROUNDS, st.sampled_from((1.0, -1.0)))
def test_a_permitted_speed_is_the_bisected_one_to_a_raw_step(angle, ground, direction):
    turns, floor = steady_turns(angle, ground.z, MACHINE), P.prediction.speed_floor
    speed = permitted_speed(angle, ground, direction, MACHINE)
    if speed < P.prediction.largest_speed:
        found = bisected(
            lambda v: stays_above(floor, direction * v, turns, ground, MACHINE), P.prediction.largest_speed
        )
        assert speed == pytest.approx(found, abs=SPEED_STEP)
        assert speed == 0.0 or stays_above(floor, direction * speed, turns, ground, MACHINE)


@unhurried
@given(SPEEDS, ANGLES, GROUNDS, st.sampled_from((0.5, -0.5)))
def test_mirrored_states_have_the_same_limits(speed, angle, ground, demand):
    mirrored, direction = Vector(ground.x, -ground.y, ground.z), math.copysign(1.0, speed)
    right, left = start(speed, angle, demand, ground), start(speed, -angle, -demand, mirrored)
    # a margin that is within its rounding of a choice may be chosen otherwise
    rate, speed = permitted_rate(right, MACHINE), permitted_speed(angle, ground, direction, MACHINE)
    assert permitted_rate(left, MACHINE) == pytest.approx(rate, abs=P.prediction.largest_rate / 64.0)
    assert permitted_speed(-angle, mirrored, direction, MACHINE) == pytest.approx(speed, abs=SPEED_STEP)


@pytest.mark.parametrize("angle", [0.2, -0.4, 0.66])
def test_a_higher_floor_permits_no_more_speed(angle):
    ground = turned_gravity(uphill(0.12), 1.0)
    found = [permitted_speed(angle, ground, 1.0, machine(speed_floor=f)) for f in (0.1, 0.2, 0.3, 0.5)]
    assert found == sorted(found, reverse=True)
    assert found[-1] < found[0]


def on_valley():
    """A left turn on a bank, right side down: its margin is least at 15 degrees, two hundredths less than at 30 and -15."""
    m, ground = raised(1600.0, arm=0.8), turned_gravity(on_bank(-0.28), 0.2)
    return m, start(0.6, math.radians(30.0), -0.5, ground, m)


def test_the_margin_over_the_angle_has_a_valley_on_a_bank():
    m, now = on_valley()
    margins = [
        least_margin(NONE, now.speed, steady_turns(math.radians(a), now.ground.z, m), now.ground, m)
        for a in (30, 15, -15)
    ]
    assert margins[0] - TRANSIENT < margins[1] < margins[0]
    assert margins[1] < margins[2]
    assert max(margins) < P.prediction.turn_floor


def test_a_valley_on_the_way_to_a_better_turn_does_not_forbid_it():
    m, now = on_valley()
    here = margin_after(NONE, now, 0.0, m)
    assert not keeps_margins(now, 0.0, m)
    assert leads_out(now, -1.0, here, m)
    assert permitted_rate(now, m) > 0.0


def test_turning_to_a_worse_turn_does_not_lead_out():
    m = raised(1600.0)
    now = start(7.0, -0.4, -0.5, LEVEL, m)
    here = margin_after(NONE, now, 0.0, m)
    assert leads_out(now, 1.0, here, m)
    assert not leads_out(now, -1.0, here, m)


def test_at_the_stop_there_is_no_way_on():
    m = raised(1600.0)
    stop = m.geometry.articulation_stop
    now = start(0.6, stop, 0.5, turned_gravity(on_bank(-0.28), 0.2), m)
    assert not leads_out(now, 1.0, margin_after(NONE, now, 0.0, m), m)


def rolling(now, rate, m):
    """The same machine while it tips over to the right, so that its support point moves there by `rate` [m/s]."""
    gained = rate * (now.front_left + now.front_right + now.rear_load) / m.geometry.front_track
    return now._replace(left_rate=-gained, right_rate=gained)


def rocking(rate, demand):
    """A slow left turn on the level in which the machine tips over to the right: the next second is bad, the turn is not."""
    m = raised(0.0)
    now = rolling(start(3.3, 0.25, demand, LEVEL, m), rate, m)
    held = predict(with_demand(now, 0.0), P.prediction.limit_hold, NONE, m).margin
    return m, now, held


def test_a_machine_that_rocks_in_a_sound_turn_may_turn_back():
    """The floor of the turn is kept, so that only the next second is compared with holding the angle."""
    m, now, held = rocking(4.0, -0.5)
    assert held < P.prediction.margin_floor
    assert margin_after(NONE, now, 0.0, m) > P.prediction.turn_floor
    rate = permitted_rate(now, m)
    assert rate > 0.0
    back = predict(with_demand(now, -rate), P.prediction.limit_hold, NONE, m).margin
    assert back > held - TRANSIENT
    assert margin_after(NONE, now, -rate, m) >= P.prediction.turn_floor - TRANSIENT


@pytest.mark.parametrize("angle", [0.02, 0.25])
def test_a_turn_that_keeps_its_floor_is_no_way_out_of_a_bounce_where_it_takes_little(angle):
    """At walking speed straight ahead is hardly better than the turn: what takes the margin is not the turn."""
    m = raised(0.0)
    slow = start(1.0, angle, -0.5, LEVEL, m)
    here = margin_after(NONE, slow, 0.0, m)
    assert (
        P.prediction.turn_floor
        < here
        < margin_after(NONE, start(1.0, 0.0, 0.0, LEVEL, m), 0.0, m)
        < here + TRANSIENT
    )
    assert not leads_out(slow, -1.0, here, m)
    thrown = slow._replace(rear_load=0.0)
    assert permitted_rate(thrown, m) == 0.0


def test_a_turn_that_keeps_its_floor_is_left_where_straight_ahead_gains_more_than_the_way_may_cost():
    m = raised(1600.0)
    quick = start(4.0, 0.3, -0.5, LEVEL, m)
    here = margin_after(NONE, quick, 0.0, m)
    assert P.prediction.turn_floor < here
    assert leads_out(quick, -1.0, here, m)


def test_slow_rates_are_offered_where_quick_ones_cost_too_much():
    m, now = on_valley()
    found = {permitted_rate(rolling(now, -rate, m), m) for rate in np.arange(0.0, 1.5, 0.05)}
    assert any(0.0 < rate < P.prediction.largest_rate / 8.0 for rate in found)


def test_a_machine_that_rocks_in_a_sound_turn_may_steer_past_straight_ahead():
    """The turn that follows is a little worse than the present one, and far above its floor."""
    m = raised(1600.0)
    now = rolling(start(3.3, 0.05, -0.5, LEVEL, m), 4.0, m)
    here = margin_after(NONE, now, 0.0, m)
    assert predict(with_demand(now, 0.0), P.prediction.limit_hold, NONE, m).margin < P.prediction.margin_floor
    rate = permitted_rate(now, m)
    assert not keeps_margins(now, -rate, m)
    assert rate == P.prediction.largest_rate
    assert P.prediction.turn_floor < margin_after(NONE, now, -rate, m) < here - TRANSIENT


def test_a_way_through_much_worse_turns_does_not_lead_out():
    """Right side down on a steeper bank: straight ahead the margin is 0.07 less than at 30 degrees to the left."""
    m, ground = raised(1600.0), turned_gravity(on_bank(-0.3), 0.3)
    now = start(0.6, math.radians(30.0), -0.5, ground, m)
    here = margin_after(NONE, now, 0.0, m)
    ahead = least_margin(NONE, now.speed, steady_turns(0.0, ground.z, m), ground, m)
    assert ahead < here - TRANSIENT
    assert not keeps_margins(now, 0.0, m)
    assert not leads_out(now, -1.0, here, m)
    assert permitted_rate(now, m) == 0.0
