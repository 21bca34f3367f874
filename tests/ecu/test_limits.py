"""The limits are within the machine's own, act at once where it matters, and give way slowly."""

import dataclasses
import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ecu.alarms import Times
from ecu.calibration import load_calibration
from ecu.estimators.signals import NEVER, Estimates
from ecu.limits import (
    NO_LEVER_LIMITS,
    Cause,
    Limits,
    next_levers,
    next_limits,
    safe,
    torque_share,
    unlimited,
)
from ecu.reasons import PREVENTION, times

CALIBRATION = load_calibration()
RULES, PREDICTION = CALIBRATION.limits, CALIBRATION.parameters.prediction
DRIVE = CALIBRATION.parameters.linkage_drive
TIMES = times(CALIBRATION.alarms)[PREVENTION]
NONE = unlimited(RULES, PREDICTION)
DT, TICK = 0.01, 10_000_000
CALM = Estimates(*([0.0] * len(Estimates._fields)))._replace(
    lift_off_margin=1.0, predicted_margin=1.0, time_to_lift_off=NEVER, speed=5.0,
    permitted_rate=PREDICTION.largest_rate, permitted_speed=PREDICTION.largest_speed, permitted_lever=math.inf,
)  # fmt: skip
VALUES = ("front_torque", "rear_torque", "speed", "rate")

estimates = st.builds(
    lambda now, later, rate, speed, v: CALM._replace(
        lift_off_margin=now, predicted_margin=later, permitted_rate=rate, permitted_speed=speed, speed=v
    ),
    st.floats(-0.5, 1.2),
    st.floats(-0.5, 1.2),
    st.floats(0, PREDICTION.largest_rate),
    st.floats(0, PREDICTION.largest_speed),
    st.floats(-8, 8),
)


def limited(seen, start=NONE):
    """The limits after each cycle."""
    now, found = start, []
    for k, e in enumerate(seen):
        now = next_limits(now, e, k * TICK, DT, TIMES, RULES, NONE, DRIVE)
        found.append(now)
    return found


@given(st.lists(estimates, min_size=1, max_size=60))
def test_limits_stay_within_the_machines_own_and_above_the_least(seen):
    for now in limited(seen):
        for name in VALUES:
            assert 0.0 <= getattr(now, name) <= getattr(NONE, name)
        assert now.speed >= RULES.creep_speed
        assert now.front_torque >= RULES.torque_least_share * RULES.front_torque * (1 - 1e-12)


@given(st.lists(estimates, min_size=1, max_size=60))
def test_limits_rise_no_faster_than_permitted(seen):
    before = NONE
    for now in limited(seen):
        assert now.rate <= before.rate + RULES.rate_rise * DT + 1e-12
        assert now.speed <= before.speed + RULES.speed_rise * DT + 1e-12
        assert now.front_torque <= before.front_torque + RULES.torque_rise * DT + 1e-9
        assert now.rear_torque <= before.rear_torque + RULES.torque_rise * DT + 1e-9
        before = now


@given(st.lists(estimates, max_size=30), estimates)
def test_the_rate_limit_is_never_above_what_the_prediction_permits(seen, last):
    assert limited([*seen, last])[-1].rate <= last.permitted_rate


def test_the_speed_limit_falls_as_the_machine_can_brake_and_starts_where_it_is():
    e = CALM._replace(speed=5.0, permitted_speed=2.0)
    found = limited([e] * 400)
    assert found[0].speed == pytest.approx(5.3 - RULES.speed_fall * DT)
    falls = [a.speed - b.speed for a, b in itertools.pairwise(found)]
    assert max(falls) <= RULES.speed_fall * DT + 1e-12
    assert found[-1].speed == 2.0


def test_when_the_danger_is_over_everything_is_given_back():
    worst = CALM._replace(lift_off_margin=0.0, predicted_margin=-1.0, permitted_rate=0.0, permitted_speed=0.0)
    found = limited([worst] * 100 + [CALM] * 2000)
    assert found[99].cause is Cause.ROLL_OVER_PREVENTION
    assert found[99].rate == 0.0
    assert found[99].speed > RULES.creep_speed  # still braking
    assert found[-1].cause is Cause.NO_LIMIT
    assert all(getattr(found[-1], name) == getattr(NONE, name) for name in VALUES)


def test_prevention_acts_in_the_same_cycle_and_does_not_let_go_for_an_instant():
    close = CALM._replace(predicted_margin=RULES.engage_margin - 0.01)
    found = limited([close] + [CALM] * 100)
    assert found[0].cause is Cause.ROLL_OVER_PREVENTION
    acting = [now.cause is Cause.ROLL_OVER_PREVENTION for now in found]
    assert sum(acting) * TICK >= TIMES.least_on_ns
    assert acting == sorted(acting, reverse=True)


@given(
    st.lists(
        st.sampled_from([RULES.engage_margin - 0.01, RULES.release_margin + 0.01]), min_size=1, max_size=200
    )
)
def test_prevention_never_flickers(margins):
    found = limited([CALM._replace(predicted_margin=margin) for margin in margins])
    acting = [now.prevention.on for now in found]
    rises = [k for k in range(1, len(acting)) if acting[k] and not acting[k - 1]] + [0] * acting[0]
    for k in rises:
        length = next((n for n in range(k, len(acting)) if not acting[n]), None)
        assert length is None or (length - k) * TICK >= TIMES.least_on_ns


def test_between_the_thresholds_prevention_stays_as_it_is():
    middle = (RULES.engage_margin + RULES.release_margin) / 2
    between, close = CALM._replace(predicted_margin=middle), CALM._replace(predicted_margin=0.0)
    assert not limited([between] * 100)[-1].prevention.on
    assert limited([close] + [between] * 1000)[-1].prevention.on


@given(st.floats(-1, 2), st.floats(-1, 2))
def test_the_torque_falls_with_the_margin_and_stays_a_share(one, other):
    low, high = sorted((torque_share(one, RULES), torque_share(other, RULES)))
    assert RULES.torque_least_share <= low <= high <= 1.0 + 1e-12
    if one <= other:
        assert torque_share(one, RULES) <= torque_share(other, RULES)
    assert torque_share(RULES.torque_full_margin, RULES) == pytest.approx(1.0)
    assert torque_share(RULES.torque_least_margin, RULES) == RULES.torque_least_share


def test_safe_values_are_within_the_machines_own():
    weak = dataclasses.replace(RULES, front_torque=1e3, rear_torque=2e3)
    for rules in (RULES, weak):
        values, own = safe(rules), unlimited(rules, PREDICTION)
        assert all(getattr(values, name) <= getattr(own, name) for name in VALUES)
        assert values.cause is Cause.SAFE_VALUES


def test_a_repeated_cycle_changes_the_prevention_no_further():
    close = CALM._replace(predicted_margin=0.0)
    once = next_limits(NONE, close, 0, DT, TIMES, RULES, NONE, DRIVE)
    twice = next_limits(once, close, 0, DT, TIMES, RULES, NONE, DRIVE)
    assert isinstance(once, Limits)
    assert once.prevention == twice.prevention
    assert Times(on_delay_ns=0, least_on_ns=TIMES.least_on_ns, off_delay_ns=TIMES.off_delay_ns) == TIMES


def test_a_driver_who_turns_back_is_not_held_by_the_limit_of_the_other_side():
    """Turning on to the right is refused; turning back to the left is permitted in the same cycle, and refused again at once."""
    right = CALM._replace(permitted_rate=0.0, permitted_direction=-1.0)
    left = CALM._replace(permitted_rate=0.6, permitted_direction=1.0)
    held = limited([right] * 50)[-1]
    freed = limited([left], held)[-1]
    assert (held.rate, freed.rate) == (0.0, 0.6)
    assert limited([right], freed)[-1].rate == 0.0


def test_without_a_demand_the_rate_limit_still_rises_slowly():
    none = CALM._replace(permitted_direction=0.0)
    held = limited([CALM._replace(permitted_rate=0.0, permitted_direction=-1.0)])[-1]
    freed = limited([none], held)[-1]
    assert 0.0 < freed.rate <= RULES.rate_rise * DT + 1e-12
    assert freed.direction == -1.0


motions = st.integers(0, 3)
lever_rates = st.floats(0.0, 2.0)


@given(st.tuples(lever_rates, lever_rates, lever_rates, lever_rates), motions, lever_rates)
def test_one_motion_of_the_levers_changes_and_the_others_stay(before, motion, permitted):
    e = CALM._replace(permitted_motion=float(motion), permitted_lever=permitted)
    after = next_levers(before, e, DT, RULES, DRIVE)
    assert [a == b for k, (a, b) in enumerate(zip(after, before, strict=True)) if k != motion] == [True] * 3
    assert after[motion] <= permitted or after[motion] == math.inf
    rise = RULES.linkage_rise * DT * 4
    assert after[motion] <= before[motion] + rise + 1e-12 or after[motion] == math.inf


def test_a_lever_limit_falls_at_once_and_comes_back_slowly_until_it_is_none():
    held = CALM._replace(permitted_motion=1.0, permitted_lever=0.05)
    free = CALM._replace(permitted_motion=1.0, permitted_lever=DRIVE.lift_down)
    found = limited([held] + [free] * 100)
    down = [now.levers[1] for now in found]
    assert down[0] == 0.05
    assert found[0].lever_cause is Cause.PRECAUTION
    steps = [b - a for a, b in itertools.pairwise(down) if b < math.inf]
    assert max(steps) == pytest.approx(RULES.linkage_rise * DT * 4)
    assert found[-1].levers == NO_LEVER_LIMITS
    assert found[-1].lever_cause is Cause.NO_LIMIT


def test_levers_are_safe_where_the_margin_is_not_known():
    values = safe(RULES)
    assert max(values.levers) < math.inf
    assert values.lever_cause is Cause.SAFE_VALUES
