"""Laws of obedience: no limit is exceeded, no limit is invented, and silence means safe values."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plant.unit.actuators import Abilities, Request, within_power
from plant.unit.limits import (
    FREE,
    UNLIMITED,
    Limits,
    LinkageLimits,
    Obedience,
    holds_back,
    in_force,
    obey,
)

ABILITIES = Abilities(
    drive_torque=(25e3, 25e3, 18e3, 18e3),
    drive_power=60e3,
    brake_torque=(14e3, 14e3, 11e3, 11e3),
    articulation_rate=0.5,
    lift_up=0.3,
    lift_down=0.5,
    tilt=1.0,
)
OBEDIENCE = Obedience(
    safe=Limits(wheel_torque=(8e3,) * 4, speed=2.0, articulation_rate=0.2),
    stale_after=0.05,
    fade=0.3,
    retard=0.3,
    brake=0.8,
    retard_share=0.3,
    brake_share=0.6,
)

torques = st.tuples(*(st.floats(-25e3, 25e3) for _ in range(4)))
brakes = st.tuples(*(st.floats(0, 14e3) for _ in range(4)))
requests = st.builds(
    Request,
    wheel_torque=torques,
    brake_torque=brakes,
    articulation_rate=st.floats(-1, 1),
    lift_rate=st.floats(-0.5, 0.3),
    tilt_rate=st.floats(-1, 1),
)
limits = st.builds(
    Limits,
    wheel_torque=st.tuples(*(st.floats(0, 30e3) for _ in range(4))),
    speed=st.floats(0, 12),
    articulation_rate=st.floats(0, 1),
    linkage=st.builds(
        LinkageLimits,
        lift_up=st.floats(0, 1),
        lift_down=st.floats(0, 1),
        tilt_back=st.floats(0, 1),
        tilt_forward=st.floats(0, 1),
    ),
)
speeds = st.floats(-12, 12)


@given(requests, speeds)
def test_without_limits_nothing_is_changed(asked, speed):
    assert obey(asked, UNLIMITED, OBEDIENCE, ABILITIES, speed=speed) == asked


@given(requests, limits, speeds)
def test_no_limit_is_exceeded(asked, limit, speed):
    done = obey(asked, limit, OBEDIENCE, ABILITIES, speed=speed)
    assert all(abs(t) <= m for t, m in zip(done.wheel_torque, limit.wheel_torque, strict=True))
    assert abs(done.articulation_rate) <= limit.articulation_rate
    assert -limit.linkage.lift_down <= done.lift_rate <= limit.linkage.lift_up
    assert -limit.linkage.tilt_forward <= done.tilt_rate <= limit.linkage.tilt_back


@given(requests, limits, speeds)
def test_at_and_above_the_speed_limit_no_wheel_drives_on(asked, limit, speed):
    done = obey(asked, limit, OBEDIENCE, ABILITIES, speed=speed)
    if abs(speed) >= limit.speed:
        assert all(t * speed <= 0 for t in done.wheel_torque)
    assert all(after >= before for after, before in zip(done.brake_torque, asked.brake_torque, strict=True))


@given(requests, limits, speeds)
def test_below_the_fading_band_the_speed_limit_does_nothing(asked, limit, speed):
    if abs(speed) <= limit.speed - OBEDIENCE.fade:
        slow = limit._replace(wheel_torque=(math.inf,) * 4, articulation_rate=math.inf, linkage=FREE)
        assert obey(asked, slow, OBEDIENCE, ABILITIES, speed=speed) == asked


@given(requests, limits, st.floats(0, 12), st.floats(0, 3))
def test_the_faster_the_less_drive_and_the_more_brake(asked, limit, speed, more):
    """Longitudinal force of the requests never rises with speed: the governor is stable."""
    free = limit._replace(wheel_torque=(math.inf,) * 4)
    slow = obey(asked, free, OBEDIENCE, ABILITIES, speed=speed)
    fast = obey(asked, free, OBEDIENCE, ABILITIES, speed=speed + more)
    assert all(f <= s + 1e-9 for f, s in zip(fast.wheel_torque, slow.wheel_torque, strict=True))
    assert all(f >= s - 1e-9 for f, s in zip(fast.brake_torque, slow.brake_torque, strict=True))


def test_far_above_the_speed_limit_the_motors_retard_and_the_service_brake_helps():
    asked = Request(
        wheel_torque=(1e4,) * 4, brake_torque=(0.0,) * 4, articulation_rate=0.0, lift_rate=0.0, tilt_rate=0.0
    )
    limit = Limits(wheel_torque=(math.inf,) * 4, speed=3.0, articulation_rate=1.0)
    done = obey(asked, limit, OBEDIENCE, ABILITIES, speed=3.0 + 0.3 + 0.8)
    assert done.wheel_torque == pytest.approx((-7.5e3, -7.5e3, -5.4e3, -5.4e3))  # 30 % of the peaks
    assert done.brake_torque == pytest.approx((8.4e3, 8.4e3, 6.6e3, 6.6e3))  # 60 % of full braking
    above = obey(asked, limit, OBEDIENCE, ABILITIES, speed=3.0 + 0.15)
    assert above.wheel_torque == pytest.approx((-3.75e3, -3.75e3, -2.7e3, -2.7e3))  # half of the way
    assert above.brake_torque == (0.0,) * 4
    reverse = obey(asked, limit, OBEDIENCE, ABILITIES, speed=-4.1)
    assert min(reverse.wheel_torque) >= 5.4e3  # reversing too fast: the motors push forward


def test_fresh_limits_hold_and_stale_ones_give_way_to_safe_values():
    last = Limits(wheel_torque=(1e3, 2e3, 3e3, 4e3), speed=9.0, articulation_rate=0.4)
    assert in_force(last, 0.05, 0.0, OBEDIENCE) == last
    assert in_force(last, 0.0501, 0.0, OBEDIENCE) == OBEDIENCE.safe


def test_before_the_first_limits_there_is_a_grace_of_the_same_length():
    assert in_force(UNLIMITED, 0.05, 0.0, OBEDIENCE) == UNLIMITED
    assert in_force(UNLIMITED, 0.0501, 0.0, OBEDIENCE) == OBEDIENCE.safe


def test_a_limit_that_is_not_available_is_replaced_by_its_own_safe_value_only():
    last = Limits(wheel_torque=(1e3, math.nan, 3e3, 4e3), speed=math.nan, articulation_rate=0.4)
    assert in_force(last, 0.0, 0.0, OBEDIENCE) == Limits(
        wheel_torque=(1e3, 8e3, 3e3, 4e3), speed=2.0, articulation_rate=0.4
    )


@given(torques, st.tuples(*(st.floats(-15, 15) for _ in range(4))))
def test_motor_power_is_bounded_and_torque_is_otherwise_untouched(torque, wheel_speed):
    request = Request(wheel_torque=torque, brake_torque=(0.0,) * 4, articulation_rate=0.1)
    done = within_power(request, wheel_speed, ABILITIES.drive_power)
    assert done.articulation_rate == 0.1
    for asked, given_torque, speed in zip(torque, done.wheel_torque, wheel_speed, strict=True):
        assert abs(given_torque * speed) <= ABILITIES.drive_power * (1 + 1e-12)
        if abs(asked * speed) <= ABILITIES.drive_power:
            assert given_torque == asked
        else:
            assert abs(given_torque * speed) == pytest.approx(ABILITIES.drive_power)
            assert math.copysign(1, given_torque) == math.copysign(1, asked)


SAFE_LINKAGE = LinkageLimits(lift_up=0.1, lift_down=0.1, tilt_back=0.2, tilt_forward=0.2)
CAREFUL = OBEDIENCE._replace(safe=OBEDIENCE.safe._replace(linkage=SAFE_LINKAGE))
rates = st.floats(0, 1)
linkages = st.builds(LinkageLimits, lift_up=rates, lift_down=rates, tilt_back=rates, tilt_forward=rates)


@given(requests, linkages)
def test_a_limit_in_one_direction_leaves_the_other(asked, linkage):
    """The arm may not fall and the bucket not dump: raising and rolling back stay free."""
    one_way = linkage._replace(lift_up=math.inf, tilt_back=math.inf)
    done = obey(asked, UNLIMITED._replace(linkage=one_way), OBEDIENCE, ABILITIES, speed=0.0)
    assert done.lift_rate == max(asked.lift_rate, -linkage.lift_down)
    assert done.tilt_rate == max(asked.tilt_rate, -linkage.tilt_forward)


@given(linkages)
def test_linkage_limits_hold_until_they_are_stale(linkage):
    last = UNLIMITED._replace(linkage=linkage)
    assert in_force(last, 0.0, CAREFUL.stale_after, CAREFUL) == last
    assert in_force(last, 0.0, 1.01 * CAREFUL.stale_after, CAREFUL) == UNLIMITED._replace(
        linkage=SAFE_LINKAGE
    )


def test_an_ecu_that_sends_no_linkage_limits_leaves_the_linkage_free():
    assert in_force(UNLIMITED, 10.0, 0.0, CAREFUL) == CAREFUL.safe._replace(linkage=FREE)


def test_a_linkage_rate_that_is_not_available_is_replaced_by_its_safe_value():
    last = LinkageLimits(lift_up=0.5, lift_down=math.nan, tilt_back=0.5, tilt_forward=0.5)
    found = in_force(UNLIMITED._replace(linkage=last), 0.0, 0.0, CAREFUL).linkage
    assert found == last._replace(lift_down=0.1)


@given(requests, limits, speeds)
def test_the_driver_is_held_back_exactly_when_drive_is_cut_or_brakes_are_added(asked, limit, speed):
    done = obey(asked, limit, OBEDIENCE, ABILITIES, speed=speed)
    same = done.wheel_torque == asked.wheel_torque and done.brake_torque == asked.brake_torque
    assert not holds_back(asked, asked)
    assert not (same and holds_back(asked, done))
    if any(d == 0.0 != a for a, d in zip(asked.wheel_torque, done.wheel_torque, strict=True)):
        assert holds_back(asked, done)
