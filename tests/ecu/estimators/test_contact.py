"""The tilt on the tyres: loads and tilt determine one another, and the filter trusts each source where it is good."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ecu.calibration import load_calibration
from ecu.estimators.joint import joint_at
from ecu.estimators.quantities import NormalForces
from ecu.estimators.tyres import tyre
from ecu.estimators.tyres.contact import (
    CONTRADICTION,
    Tilt,
    carried,
    contradicts,
    followed,
    load_rates,
    shifted,
    springs,
    stands,
    tilt_of,
)

unhurried = settings(deadline=None)  # the first example compiles
P = load_calibration().parameters
WHEEL, GEOMETRY, CONTACT = P.wheel, P.geometry, P.contact
AXLE_WEIGHT = P.axle.mass * 9.81
NOTHING = Tilt(0.0, 0.0)
DT = 0.01

loads = st.floats(15e3, 60e3)
angles = st.floats(-0.69, 0.69)
small = st.floats(-1e-5, 1e-5)


def forces(left, right, rear_left, rear_right):
    return NormalForces(left, right, rear_left + rear_right - AXLE_WEIGHT, rear_left, rear_right)


four = st.builds(forces, loads, loads, loads, loads)


def deflections(roll, pitch, angle, height=0.0):
    """Deflection of the front left, front right and mean rear tyre of a rigid frame that tilts: plain geometry."""
    half, lf, lr = GEOMETRY.front_track / 2, GEOMETRY.front_length, GEOMETRY.rear_length
    c, s = math.cos(angle), math.sin(angle)
    points = np.array(
        [[lf * c - half * s, lf * s + half * c], [lf * c + half * s, lf * s - half * c], [-lr, 0.0]]
    )
    return -(height + points[:, 1] * roll - points[:, 0] * pitch)


@unhurried
@given(four, angles)
def test_the_tilt_is_the_plane_through_the_tyres_deflections(n, angle):
    tilt = tilt_of(n, joint_at(angle), WHEEL, GEOMETRY)
    left = tyre.deflection(n.front_left, WHEEL.front_stiffening, WHEEL)
    right = tyre.deflection(n.front_right, WHEEL.front_stiffening, WHEEL)
    rear = tyre.deflection((n.rear_left + n.rear_right) / 2, WHEEL.rear_stiffening, WHEEL)
    found = deflections(tilt.roll, tilt.pitch, angle)
    assert found - found[2] == pytest.approx(np.array([left, right, rear]) - rear, abs=1e-9)


@unhurried
@given(four, angles, small, small)
def test_a_shift_changes_the_tilt_by_what_it_was_asked_for_and_keeps_the_weight(n, angle, roll, pitch):
    stiffness = springs(n, WHEEL)
    then = shifted(n, Tilt(roll, pitch), joint_at(angle), stiffness, GEOMETRY)
    assert sum(then) - then.pivot == pytest.approx(sum(n) - n.pivot, rel=1e-12)
    before, after = (
        tilt_of(n, joint_at(angle), WHEEL, GEOMETRY),
        tilt_of(then, joint_at(angle), WHEEL, GEOMETRY),
    )
    assert after.roll - before.roll == pytest.approx(roll, abs=2e-7)
    assert after.pitch - before.pitch == pytest.approx(pitch, abs=2e-7)
    assert then.rear_right - then.rear_left == pytest.approx(n.rear_right - n.rear_left, abs=1e-6)


@unhurried
@given(st.floats(1e3, 100e3), st.floats(0.5, 2.0))
def test_stiffness_is_the_slope_of_the_radial_law(load, stiffening):
    rho = tyre.deflection(load, stiffening, WHEEL)
    step = 1e-7
    slope = tyre.radial_force(rho + step, stiffening, WHEEL) - tyre.radial_force(
        rho - step, stiffening, WHEEL
    )
    assert tyre.radial_stiffness(load, stiffening, WHEEL) == pytest.approx(slope / (2 * step), rel=1e-5)


def filtered(gyro, balanced, seconds, yaw=0.0):
    """Run the filter over functions of time; returns the last state and the time."""
    tilt, bias, state = balanced(0.0), NOTHING, None
    for k in range(1, round(seconds / DT) + 1):
        state = followed(tilt, bias, gyro(k * DT), yaw, balanced(k * DT), float(k), DT, CONTACT)
        tilt, bias = state.tilt, state.bias
    return state


def test_a_biased_gyro_is_found_out_and_leaves_no_error():
    bias, still = Tilt(math.radians(0.2), math.radians(-0.15)), Tilt(0.01, -0.02)
    state = filtered(lambda t: bias, lambda t: still, 60.0)
    assert state.bias == pytest.approx(bias, abs=1e-5)
    assert state.tilt == pytest.approx(still, abs=1e-6)


def test_within_a_second_most_of_the_bias_is_known():
    bias = Tilt(math.radians(0.2), 0.0)
    assert filtered(lambda t: bias, lambda t: NOTHING, 1.0).bias.roll == pytest.approx(bias.roll, rel=0.3)


def test_a_pitch_at_its_own_frequency_is_taken_from_the_gyro():
    """2.4 Hz, and a balance of forces that comes 40 ms late: its error would be 60 %."""
    w, amplitude = 2 * math.pi * 2.4, 0.02
    gyro = lambda t: Tilt(0.0, amplitude * w * math.cos(w * (t - DT / 2)))  # noqa: E731
    late = lambda t: Tilt(0.0, amplitude * math.sin(w * (t - 0.040)))  # noqa: E731
    state = filtered(gyro, late, 10.0)
    assert state.tilt.pitch == pytest.approx(amplitude * math.sin(w * 10.0), abs=0.1 * amplitude)


def test_a_slow_lean_is_taken_from_the_balance():
    """A road that tips by 1 mrad/s under the machine: no gyro shows it, the balance of forces does."""
    state = filtered(lambda t: NOTHING, lambda t: Tilt(1e-3 * t, 0.0), 30.0)
    assert state.tilt.roll == pytest.approx(0.030, abs=1e-3)


def test_a_road_that_tips_at_once_is_not_taken_for_a_tilt_on_the_tyres():
    """A step of 16 cm under one side, 0.08 rad in a tenth of a second: the gyro sees it, the tyres are loaded as before."""
    step = lambda t: Tilt(0.8 if 1.5 <= t < 1.6 else 0.0, 0.0)  # noqa: E731
    errors = [abs(filtered(step, lambda t: NOTHING, t).tilt.roll) for t in (1.55, 1.6, 1.7, 2.0, 3.0)]
    assert max(errors) <= CONTRADICTION
    assert errors[-1] < 0.1 * 0.08
    assert abs(filtered(step, lambda t: NOTHING, 3.0).bias.roll) < 0.1 * 0.08 / 0.5


def test_a_balance_that_is_late_does_not_contradict_the_gyro():
    """A pitch of 2.4 Hz that lifts and presses an axle by 15 kN, seen 40 ms late, is far within the bound."""
    w, amplitude = 2 * math.pi * 2.4, 0.02
    lateness = max(
        abs(amplitude * (math.sin(w * t) - math.sin(w * (t - 0.040)))) for t in np.arange(0, 1, DT)
    )
    assert not contradicts(Tilt(0.0, lateness))
    assert contradicts(Tilt(0.0, -2.0 * lateness))


def test_turning_on_a_tilted_frame_turns_the_tilt():
    """A quarter turn to the left: what leaned to the left (roll left side down) then leans forward or back."""
    tilt, bias = Tilt(0.01, 0.0), NOTHING
    yaw = 0.5
    for _ in range(round(math.pi / 2 / yaw / 0.001)):
        tilt = followed(tilt, bias, NOTHING, yaw, tilt, 1e9, 0.001, CONTACT).tilt
    assert tilt.roll == pytest.approx(0.0, abs=1e-4)
    assert abs(tilt.pitch) == pytest.approx(0.01, rel=0.01)


@unhurried
@given(four, angles)
def test_at_rest_the_carried_forces_are_those_of_the_balance(n, angle):
    tilt = tilt_of(n, joint_at(angle), WHEEL, GEOMETRY)
    assert carried(n, tilt, NOTHING, joint_at(angle), DT, WHEEL, GEOMETRY, CONTACT) == pytest.approx(n)


def test_a_rolling_machine_is_seen_ahead_by_latency_and_damping():
    """Rolling with the left side up: the left tyre is unloaded by stiffness times what it will have risen."""
    n, rate = forces(30e3, 30e3, 30e3, 30e3), Tilt(0.05, 0.0)
    tilt = tilt_of(n, joint_at(0.0), WHEEL, GEOMETRY)
    ahead = carried(n, tilt, rate, joint_at(0.0), DT, WHEEL, GEOMETRY, CONTACT)
    stiffness, half = tyre.radial_stiffness(30e3, 1.0, WHEEL), GEOMETRY.front_track / 2
    speed = 0.05 * half
    expected = -(stiffness * (CONTACT.latency - DT / 2) + CONTACT.damping) * speed
    assert ahead.front_left - 30e3 == pytest.approx(expected, rel=1e-6)
    assert ahead.front_right - 30e3 == pytest.approx(-expected, rel=1e-6)


@unhurried
@given(four, angles, st.floats(-0.1, 0.1), st.floats(-0.1, 0.1))
def test_the_rates_of_the_front_loads_are_their_differences(n, angle, roll, pitch):
    step, joint, stiffness = 1e-6, joint_at(angle), springs(n, WHEEL)
    before, after = (
        shifted(n, Tilt(roll * time, pitch * time), joint, stiffness, GEOMETRY) for time in (-step, step)
    )
    left, right = load_rates(n, Tilt(roll, pitch), joint, WHEEL, GEOMETRY)
    assert left == pytest.approx((after.front_left - before.front_left) / (2 * step), abs=1.0)
    assert right == pytest.approx((after.front_right - before.front_right) / (2 * step), abs=1.0)


def test_a_lifted_wheel_is_seen():
    assert stands(forces(1.0, 1e4, 1e4, 1e4))
    assert not stands(forces(-1.0, 1e4, 1e4, 1e4))
    assert not stands(forces(1e4, 1e4, 1e4, 0.0))
