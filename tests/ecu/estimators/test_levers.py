"""Permitted rates of lift arm and bucket: what they lead to, and how the axles swing on their tyres meanwhile."""

import itertools
import math

import pytest

from ecu.calibration import load_calibration
from ecu.estimators.joint import joint_at
from ecu.estimators.loads.arm_forces import ArmForces
from ecu.estimators.loads.cog import front_unit
from ecu.estimators.loads.normal_force import Support, normal_forces
from ecu.estimators.motion.arm import Turning
from ecu.estimators.quantities import NormalForces, Vector
from ecu.estimators.stability.levers import (
    LIFT_DOWN,
    LIFT_UP,
    MOTIONS,
    TILT_FORWARD,
    Levers,
    demanded,
    followed,
    largest,
    share_followed,
    with_motion,
)
from ecu.estimators.stability.permitted_levers import (
    AMPLE,
    SOON,
    gentlest_stop,
    keeps_with_lever,
    largest_loss,
    permitted_lever,
)
from ecu.estimators.stability.prediction import predict, with_levers
from ecu.estimators.stability.rollover import loaded_machine, share_lost, steady_rate
from ecu.estimators.stability.steady import steady_forces, steady_turns
from ecu.estimators.stability.step import PredictionState
from ecu.estimators.tyres.contact import Tilt, load_rates, shifted, springs

P = load_calibration().parameters
DRIVE, RULES = P.linkage_drive, P.prediction
G = 9.81
LEVEL = Vector(0.0, 0.0, G)
UP, CARRIED = 0.8, -0.65
TURNS = ((0.0, 0.3), (3.0, 0.3), (3.0, -0.5), (6.0, 0.15))


def machine(arm, payload, **prediction):
    given = P._replace(prediction=RULES._replace(**prediction))
    return loaded_machine(front_unit(arm, 0.2, payload, P.front, P.arm, P.bucket), payload, given)


def start(speed, angle, arm, m, ground=LEVEL):
    """A steady turn with the arm at rest."""
    turn = steady_rate(speed, angle, m.wheel.lateral_peak, m.geometry)
    n = steady_forces(speed, turn, steady_turns(angle, ground.z, m), ground, m)
    return PredictionState(
        angle, 0.0, 0.0, speed, 0.0, *ground, ground, m.geometry.rear_length * turn, turn,
        n.front_left, n.front_right, n.rear_left + n.rear_right, 0.0, 0.0,
        Levers(arm, 0.0, 0.0, 0.2, 0.0, 0.0),
    )  # fmt: skip


def permitted(now, motion, m):
    """The permitted rate over the full one."""
    ahead = predict(now, RULES.demand_hold, 0.0, m)
    return permitted_lever(now, motion, ahead.margin, m) / largest(motion, m.drive)


@pytest.mark.parametrize("payload", [0.0, 3204.0])
@pytest.mark.parametrize("motion", range(MOTIONS))
def test_straight_ahead_every_lever_is_free(motion, payload):
    m = machine(CARRIED, payload)
    assert permitted(start(5.0, 0.0, CARRIED, m), motion, m) == 1.0


@pytest.mark.parametrize("angle", [0.35, -0.35])
def test_a_raised_load_comes_down_slower_in_a_turn(angle):
    """But not never; alike to either side. Where it stands, too, a full lever let go lifts the rear wheels of this machine."""
    m, empty = machine(UP, 3204.0), machine(UP, 0.0)
    assert permitted(start(0.5, angle, UP, empty), LIFT_DOWN, empty) == 1.0
    standing, turning = (permitted(start(v, angle, UP, m), LIFT_DOWN, m) for v in (0.0, 5.0))
    assert 0.0 < turning < standing < 1.0
    assert permitted(start(5.0, -angle, UP, m), LIFT_DOWN, m) == pytest.approx(turning, rel=1e-9)


@pytest.mark.parametrize(("speed", "angle", "arm"), [(4.0, 0.35, 0.8), (5.0, 0.2, 0.7), (4.5, -0.3, 0.5)])
@pytest.mark.parametrize("motion", [LIFT_DOWN, TILT_FORWARD])
def test_at_the_permitted_rate_the_margins_are_kept(speed, angle, arm, motion):
    m = machine(arm, 3204.0)
    now = start(speed, angle, arm, m)
    rate = permitted(now, motion, m) * largest(motion, m.drive)
    assert keeps_with_lever(now, motion, rate, m)
    assert (
        predict(with_levers(now, with_motion(now.levers, motion, rate)), RULES.limit_hold, 0.0, m).margin
        > RULES.margin_floor
    )


@pytest.mark.parametrize("arm", [-0.65, 0.0, 0.8])
@pytest.mark.parametrize("payload", [0.0, 1600.0, 3204.0])
def test_a_motion_permitted_without_prediction_keeps_the_margins(arm, payload):
    """The cheap estimate never passes what the whole prediction refuses; in turns to both sides."""
    m = machine(arm, payload)
    for motion, (speed, angle) in itertools.product(range(MOTIONS), TURNS):
        now = start(speed, angle, arm, m)
        margin = predict(now, RULES.demand_hold, 0.0, m).margin
        if margin - largest_loss(now, motion, m) > RULES.margin_floor + AMPLE:
            assert keeps_with_lever(now, motion, largest(motion, m.drive), m)


def test_some_motions_are_permitted_without_prediction():
    m = machine(CARRIED, 0.0)
    now = start(6.0, 0.15, CARRIED, m)
    assert predict(now, RULES.demand_hold, 0.0, m).margin > RULES.margin_floor + AMPLE
    assert largest_loss(now, LIFT_UP, m) < 0.25


def test_on_a_bank_a_raised_load_may_come_down_and_not_go_up():
    """Right side up by 17 deg, arm up, 3204 kg: standing still already violates the floor."""
    m, ground = machine(0.7, 3204.0), Vector(0.0, -G * math.sin(0.3), G * math.cos(0.3))
    now = start(0.0, 0.0, 0.7, m, ground)
    assert not keeps_with_lever(now, LIFT_DOWN, 0.0, m)
    assert permitted(now, LIFT_DOWN, m) > 0.0
    assert permitted(now, LIFT_UP, m) == 0.0


def test_pitching_loads_one_axle_by_what_it_takes_from_the_other():
    n, joint = NormalForces(5e4, 5e4, 3e4, 2e4, 2e4), joint_at(0.0)
    nose_down, rolling = (
        load_rates(n, rate, joint, P.wheel, P.geometry) for rate in (Tilt(0.0, 0.1), Tilt(0.1, 0.0))
    )
    then = shifted(n, Tilt(0.0, 0.1), joint, springs(n, P.wheel), P.geometry)
    assert nose_down[0] > 0.0
    assert nose_down[0] == pytest.approx(nose_down[1])
    assert then.rear_left + then.rear_right - 4e4 == pytest.approx(-sum(nose_down))
    assert rolling[0] < 0.0 < rolling[1]  # left up
    assert sum(rolling) == pytest.approx(0.0, abs=1.0)


@pytest.mark.parametrize("rocking", [-4e5, 4e5])
def test_a_motion_may_end_early_and_late(rocking):
    """Axles that swing bear the end of a motion at one moment and not at another."""
    m = machine(0.3, 3204.0)
    now = start(4.0, 0.3, 0.3, m)._replace(left_rate=rocking / 2.0, right_rate=rocking / 2.0)
    rate = permitted(now, LIFT_DOWN, m) * largest(LIFT_DOWN, m.drive)
    moving = with_levers(now, with_motion(now.levers, LIFT_DOWN, rate))
    if keeps_with_lever(now, LIFT_DOWN, 0.0, m):
        for hold in (SOON, RULES.limit_hold):
            assert predict(moving, hold, 0.0, m).margin > RULES.margin_floor


@pytest.mark.parametrize("lift_rate", [-0.5, -0.55])
def test_where_the_end_of_a_motion_would_lift_a_wheel_it_is_slowed_in_steps(lift_rate):
    """A heavy arm that comes down at full rate: of what the limits could ask for, the motion ends with the largest margin."""
    m = machine(0.2, 3204.0)
    now = start(5.5, 0.3, 0.2, m)
    now = with_levers(now, now.levers._replace(lift_rate=lift_rate))
    rested = predict(
        with_levers(now, with_motion(now.levers, LIFT_DOWN, 0.0)), RULES.limit_hold, -1e9, m
    ).margin
    assert rested < RULES.margin_floor
    rate = gentlest_stop(now, LIFT_DOWN, rested, m)
    assert 0.0 <= rate <= -lift_rate
    found = predict(
        with_levers(now, with_motion(now.levers, LIFT_DOWN, rate)), RULES.limit_hold, -1e9, m
    ).margin
    assert found >= rested
    assert permitted_lever(now, LIFT_DOWN, rested, m) >= rate


@pytest.mark.parametrize("angle", [-0.5, 0.0, 0.4])
def test_the_share_lost_is_that_of_the_balance(angle):
    """Forces of the arm added to a standing machine: the same change as by support point and triangle."""
    m = machine(UP, 3204.0)
    arm = ArmForces(2e3, 3e3, -8e3, -2.5e4, -1.2e4, 9e3)
    n = m.standing
    c, s = math.cos(angle), math.sin(angle)
    load = n.front_left + n.front_right + n.pivot
    base = normal_forces(Support(load, 0.4, 0.0), joint_at(angle), 0.0, 0.0, m.geometry)
    more = load + arm.z
    x = (load * 0.4 + arm.pitching * c - arm.rolling * s) / more
    y = (arm.pitching * s + arm.rolling * c) / more
    then = normal_forces(Support(more, x, y), joint_at(angle), 0.0, 0.0, m.geometry)
    lost = [(b - t) / w for b, t, w in zip(base, then, n, strict=True)]
    del lost[2]  # the pivot
    assert share_lost(arm, angle, m) == pytest.approx(max(lost), rel=1e-9)


def test_a_part_follows_its_demand_and_stops_at_the_end_of_its_stroke():
    part, dt = Turning(0.0, 0.0, 0.0, 0.0), 0.01
    for _ in range(20):
        part = followed(part, 0.4, dt, share_followed(dt, DRIVE), -0.8, 0.8, DRIVE.cushion)
    assert part.rate == pytest.approx(0.4 * (1.0 - math.exp(-0.2 / DRIVE.lag)))
    for _ in range(2000):
        part = followed(part, 0.4, dt, share_followed(dt, DRIVE), -0.8, 0.8, DRIVE.cushion)
    assert part.angle <= 0.8
    assert part.rate == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(
    ("lever", "rate"), [(1.0, 0.2), (0.5, 0.15), (-1.0, -0.1), (-0.1, -0.05), (0.0, 0.0)]
)
def test_a_lever_asks_for_its_share_and_gets_what_is_permitted(lever, rate):
    assert demanded(lever, 0.3, 0.5, 0.2, 0.1) == pytest.approx(rate)
