"""Laws of the driver: hands and feet have bounded rates, loops close, no reversing to brake."""

import math
from functools import partial

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plant.unit.driver import Demand, DriverParameters, DriverState, drive
from plant.unit.script import Wish

DT = 0.01
DRIVER = DriverParameters(
    speed_gain=0.4,
    speed_integral=0.15,
    retardation=0.15,
    accelerator_rate=3.0,
    brake_rate=6.7,
    articulation_gain=3.0,
    articulation_rate=0.5,
    articulation_acceleration=3.5,
)

shares = st.floats(-1, 1)


def of_wish(**given):
    # not Wish itself: Hypothesis would also draw what is not given
    return Wish(**given)


demands = st.builds(
    partial(Demand, lift=0.0, tilt=0.0),
    torque=shares,
    brake=st.floats(0, 1),
    articulation_rate=st.floats(-0.5, 0.5),
)
states = st.builds(DriverState, demand=demands, integral=shares)
wishes = st.one_of(
    st.builds(
        of_wish, speed=st.floats(-5, 10), articulation_angle=st.floats(-0.7, 0.7), brake=st.floats(0, 1)
    ),
    st.builds(of_wish, torque=shares, articulation_rate=st.floats(-2, 2)),
)


@given(states, wishes, st.floats(-10, 10), st.floats(-0.7, 0.7))
def test_pedals_and_joystick_are_bounded_and_move_at_bounded_rates(state, wish, speed, angle):
    after = drive(state, DRIVER, wish, speed=speed, articulation_angle=angle, dt=DT).demand
    before = state.demand
    assert -1 <= after.torque <= 1
    assert 0 <= after.brake <= 1
    assert abs(after.articulation_rate) <= DRIVER.articulation_rate + 1e-12
    assert abs(after.torque - before.torque) <= DRIVER.accelerator_rate * DT + 1e-12
    assert abs(after.brake - before.brake) <= DRIVER.brake_rate * DT + 1e-12
    assert (
        abs(after.articulation_rate - before.articulation_rate)
        <= DRIVER.articulation_acceleration * DT + 1e-12
    )


def hold(wish, *, speed, angle=0.0, seconds=2.0, state=None):
    """The demand after the wish has been held at a constant measurement."""
    state = state or DriverState()
    for _ in range(round(seconds / DT)):
        state = drive(state, DRIVER, wish, speed=speed, articulation_angle=angle, dt=DT)
    return state


@given(st.floats(0.5, 8))
def test_against_the_motion_there_is_retardation_and_brake_but_no_reversing(speed):
    """Wanting to stop from forward motion never asks for more reverse torque than lifting the foot gives."""
    demand = hold(Wish(speed=0.0), speed=speed).demand
    assert -DRIVER.retardation - 1e-12 <= demand.torque <= 0
    assert demand.brake > 0


def test_standing_with_no_speed_wanted_the_brake_holds_and_the_integral_is_empty():
    state = hold(Wish(speed=0.0), speed=0.02, state=DriverState(integral=0.5, demand=Demand(torque=0.5)))
    assert state.demand.torque == pytest.approx(0.0, abs=1e-12)
    assert state.demand.brake == pytest.approx(DRIVER.holding_brake)
    assert state.integral == 0


def test_the_integral_does_not_wind_up_while_the_pedal_is_on_the_floor():
    """3 m/s of error ask for 120 % from the first step on, so nothing is ever integrated."""
    state = hold(Wish(speed=3.0), speed=0.0, seconds=20)
    assert state.demand.torque == pytest.approx(1.0)
    assert state.integral == 0


def test_while_the_script_brakes_the_accelerator_is_up():
    state = hold(Wish(speed=5.0), speed=3.0)
    assert state.demand.torque > 0
    braking = hold(Wish(speed=5.0, brake=0.6), speed=3.0, state=state).demand
    assert braking.torque == pytest.approx(0.0, abs=1e-12)
    assert braking.brake == pytest.approx(0.6)


@given(st.floats(-0.6, 0.6))
def test_steering_closes_the_loop_on_the_angle(target):
    """A machine whose joint follows the joystick exactly ends at the wanted angle."""
    state, angle = DriverState(), 0.0
    for _ in range(500):
        state = drive(
            state, DRIVER, Wish(articulation_angle=target), speed=2.0, articulation_angle=angle, dt=DT
        )
        angle += state.demand.articulation_rate * DT
    assert angle == pytest.approx(target, abs=1e-3)


@settings(max_examples=20)
def peak_speed(*, limited_s: float, limit: float = 20.0 / 3.6, target: float = 25.0 / 3.6) -> float:
    """Largest speed [m/s] of the point mass below, started at the limit, which holds for `limited_s`."""
    state, speed, held_back, peak = DriverState(), limit, False, 0.0
    for tick in range(round((limited_s + 60.0) / DT)):
        state = drive(
            state, DRIVER, Wish(speed=target), speed=speed, articulation_angle=0.0, dt=DT, held_back=held_back
        )
        torque = state.demand.torque
        if tick * DT < limited_s:
            torque = min(torque, max(0.0, 3e3 / 42e3 + (limit - speed)))  # holds the speed against the drag
        held_back = torque < state.demand.torque
        speed += (torque * 42e3 - 3e3 - state.demand.brake * 60e3) / 12e3 * DT
        peak = max(peak, speed)
    return peak


def test_a_limit_that_ends_finds_no_wound_up_pedal():
    assert peak_speed(limited_s=30.0) <= peak_speed(limited_s=0.0) + 0.02


@given(st.floats(1, 8))
def test_speed_is_held_without_offset_against_a_constant_drag(target):
    """A point mass of 12 t with 30 kN m/(0.72 m) full force and 3 kN of drag settles at the target."""
    state, speed = DriverState(), 0.0
    for _ in range(6000):
        state = drive(state, DRIVER, Wish(speed=target), speed=speed, articulation_angle=0.0, dt=DT)
        demand = state.demand
        drag = (3e3 + demand.brake * 60e3) * math.tanh(speed / 0.05)
        speed += (demand.torque * 42e3 - drag) / 12e3 * DT
    assert speed == pytest.approx(target, abs=0.01)


def test_left_and_right_forward_and_backward_are_mirror_images():
    wish = Wish(speed=3.0, articulation_angle=0.3, articulation_angle_rate=0.1)
    mirror = wish._replace(speed=-3.0, articulation_angle=-0.3, articulation_angle_rate=-0.1)
    one = hold(wish, speed=1.0, angle=0.1).demand
    other = hold(mirror, speed=-1.0, angle=-0.1).demand
    assert (other.torque, other.articulation_rate) == (-one.torque, -one.articulation_rate)
    assert other.brake == one.brake
