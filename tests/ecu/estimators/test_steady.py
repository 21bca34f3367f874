"""Steady turns on slopes: what the machine leans on, and that its loads are the sums of their parts."""

import math

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ecu.calibration import load_calibration
from ecu.estimators.joint import joint_at
from ecu.estimators.loads.cog import front_unit
from ecu.estimators.loads.normal_force import normal_forces
from ecu.estimators.quantities import NormalForces, Vector
from ecu.estimators.stability.rollover import loaded_machine, margin, steady_loads, steady_rate
from ecu.estimators.stability.steady import (
    leaned,
    least_margin,
    steady_forces,
    steady_turns,
    turned_gravity,
)
from ecu.estimators.tyres.contact import Tilt

P = load_calibration().parameters
G = 9.81
LEVEL = Vector(0.0, 0.0, G)

unhurried = settings(deadline=None)  # the first example compiles
speeds, angles = st.floats(-8.0, 14.0), st.floats(-0.69, 0.69)
slopes = st.builds(Vector, st.floats(-2.5, 2.5), st.floats(-2.5, 2.5), st.floats(8.5, 10.5))


def machine(wheel=P.wheel, payload=0.0, arm=-0.65, **prediction):
    """The machine with the bucket carried, other numbers of its prediction."""
    given = P._replace(wheel=wheel, prediction=P.prediction._replace(**prediction))
    return loaded_machine(front_unit(arm, 0.82, payload, P.front, P.arm, P.bucket), payload, given)


MACHINE = machine()


def uphill(angle):
    """What an accelerometer reads on a machine that stands nose up by `angle`."""
    return Vector(G * math.sin(angle), 0.0, G * math.cos(angle))


def turning_forces(speed, angle, ground, m):
    rate = steady_rate(speed, angle, m.wheel.lateral_peak, m.geometry)
    return steady_forces(speed, rate, steady_turns(angle, ground.z, m), ground, m)


def hard(m):
    """The machine on tyres that hardly give way."""
    tyre = m.wheel
    return m._replace(
        wheel=tyre._replace(
            radial_linear=1e6 * tyre.radial_linear, radial_quadratic=1e6 * tyre.radial_quadratic
        )
    )


def test_turning_on_the_spot_turns_gravity_the_other_way():
    """Nose up, a quarter turn to the left brings the right side up: the reading points to the right."""
    turned = turned_gravity(uphill(0.15), math.pi / 2)
    assert turned == pytest.approx((0.0, -G * math.sin(0.15), G * math.cos(0.15)), abs=1e-12)
    assert turned_gravity(turned, -math.pi / 2) == pytest.approx(uphill(0.15), abs=1e-12)


def test_leaning_with_the_slope_is_standing_on_it():
    """A body nose down and left side up by small angles reads what it would on a slope of these angles."""
    assert leaned(LEVEL, Tilt(0.01, 0.02)) == pytest.approx((-0.02 * G, 0.01 * G, G))


def rigid_margin(speed, angle, ground, m):
    """Margin of the turn on tyres that do not give way."""
    loads = steady_loads(speed, angle, ground, m.wheel.lateral_peak, m.front, m.rear, m.axle, m.geometry)
    forces = normal_forces(loads.support, joint_at(angle), loads.axle_load, loads.axle_moment, m.geometry)
    return margin(forces, m.standing).ratio


@pytest.mark.parametrize("hardness", [1e3, 1.0])
def test_a_machine_leans_to_its_outer_side_as_its_tyres_are_soft(hardness):
    """Hard tyres: the rigid machine. Soft ones take more from the inner wheel, by weight times height over stiffness.

    The lean is the roll moment M over the front tyres' stiffness K; it moves the weight that leans, W at the height h
    above the roll axis, and so adds W h / K of M, and that of this: M / (1 - W h / K).
    """
    tyre = P.wheel
    wheel = tyre._replace(
        radial_linear=hardness * tyre.radial_linear, radial_quadratic=hardness * tyre.radial_quadratic
    )
    m = machine(wheel)
    speed, angle = 4.5, 0.3
    lost = 1.0 - rigid_margin(speed, angle, LEVEL, m)
    leaning = 1.0 - margin(turning_forces(speed, angle, LEVEL, m), m.standing).ratio
    standing = 1.0 - rigid_margin(0.0, angle, LEVEL, m)
    gain = (leaning - standing) / (lost - standing)
    if hardness > 1.0:
        assert gain == pytest.approx(1.0, abs=2e-3)
        return
    k = (
        P.wheel.nominal_load
        * (tyre.radial_linear + 2.0 * tyre.radial_quadratic * 0.05)
        / tyre.unloaded_radius
    )
    half = P.geometry.front_track / 2.0
    height = (m.front.mass * m.front.z + m.rear.mass * m.rear.z) - (m.front.mass + m.rear.mass) * 0.4
    ratio = G * height / (2.0 * k * half**2)
    expected = sum(ratio**n for n in range(3))
    assert gain == pytest.approx(expected, abs=0.1)
    assert gain > 1.05


@unhurried
@given(speeds, angles, slopes)
@example(14.0, 0.69, Vector(0.0, 2.5, 9.5))  # beyond the grip of the tyres
def test_loads_of_a_turn_are_the_sum_of_its_parts(speed, angle, ground):
    """On hard tyres: the balance of the same turn, made at once."""
    m = hard(machine(payload=3204.0, arm=0.7))
    loads = steady_loads(speed, angle, ground, m.wheel.lateral_peak, m.front, m.rear, m.axle, m.geometry)
    at_once = normal_forces(loads.support, joint_at(angle), loads.axle_load, loads.axle_moment, m.geometry)
    assert turning_forces(speed, angle, ground, m) == pytest.approx(at_once, rel=1e-4, abs=1.0)


@unhurried
@given(speeds, angles, slopes)
def test_mirrored_turns_have_mirrored_loads(speed, angle, ground):
    n = turning_forces(speed, angle, ground, MACHINE)
    mirrored = turning_forces(speed, -angle, ground._replace(y=-ground.y), MACHINE)
    swapped = NormalForces(n.front_right, n.front_left, n.pivot, n.rear_right, n.rear_left)
    assert mirrored == pytest.approx(swapped, rel=1e-9, abs=1e-6)


@unhurried
@given(speeds, angles, slopes, st.floats(0.0, 1.0))
def test_a_floor_ends_the_search_and_changes_no_verdict(speed, angle, ground, floor):
    turns = steady_turns(angle, ground.z, MACHINE)
    least, stopped = (least_margin(f, speed, turns, ground, MACHINE) for f in (-1e9, floor))
    assert (stopped >= floor) == (least >= floor)
    assert least <= stopped


def test_a_machine_that_stands_is_judged_at_its_heading_alone():
    """Its turn does not go on, however far the search looks ahead."""
    right_up = turned_gravity(uphill(0.15), math.pi / 2)
    turns = steady_turns(0.6, right_up.z, MACHINE)
    here = margin(turning_forces(0.0, 0.6, right_up, MACHINE), MACHINE.standing).ratio
    assert least_margin(-1e9, 0.0, turns, right_up, machine(turn_ahead=9.0)) == here
