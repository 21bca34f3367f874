"""Steering cylinders: moment arms by virtual work, pressures by the balance of moments, stroke of the machine sheet."""

import math

import numpy as np
import pytest

from plant.physics.steering import cylinders_of, steering_cylinder, steering_pressures
from plant.plant import Commands, Plant
from plant.sheets.machine import load_machine

MACHINES = pytest.mark.parametrize("name", ["l60", "compact"])


def length(steering, angle, side):
    """Between the pins of a cylinder, from the machine file; side: left +1, right -1."""
    c, s = math.cos(angle), math.sin(angle)
    front = np.array(
        (
            c * steering.front_pin_x - s * side * steering.front_pin_y,
            s * steering.front_pin_x + c * side * steering.front_pin_y,
        )
    )
    return np.linalg.norm(front - (steering.rear_pin_x, side * steering.rear_pin_y))


@MACHINES
@pytest.mark.parametrize("angle", [-0.6, -0.2, 0.0, 0.4, 0.66])
def test_moment_arms_are_the_derivatives_of_the_lengths(name, angle):
    """Over 2e-6 rad: 1e-8 m. The left cylinder shortens as the machine turns left, the right one lengthens."""
    steering, h = load_machine(name).steering, 1e-6
    k = cylinders_of(steering)
    left, right = (
        (length(steering, angle + h, side) - length(steering, angle - h, side)) / (2 * h) for side in (1, -1)
    )
    assert steering_cylinder(k, angle)[0] == pytest.approx(length(steering, angle, 1), abs=1e-12)
    assert steering_cylinder(k, angle)[1] == pytest.approx(-left, abs=1e-8)
    assert steering_cylinder(k, -angle)[1] == pytest.approx(right, abs=1e-8)
    assert left < 0.0 < right


@MACHINES
@pytest.mark.parametrize("angle", [-0.5, 0.0, 0.6])
@pytest.mark.parametrize("torque", [-20e3, -100.0, 0.0, 5e3])
def test_the_forces_of_both_cylinders_make_up_the_torque(name, angle, torque):
    """Push of each cylinder by its two pressures, times its change of length; no line is below the back pressure."""
    steering, h = load_machine(name).steering, 1e-6
    to_left, to_right = steering_pressures(cylinders_of(steering), angle, torque)
    head = math.pi / 4 * steering.bore**2
    rod = head - math.pi / 4 * steering.rod**2
    push = {1: to_right * head - to_left * rod, -1: to_left * head - to_right * rod}
    found = sum(
        push[side] * (length(steering, angle + h, side) - length(steering, angle - h, side)) / (2 * h)
        for side in (1, -1)
    )
    assert found == pytest.approx(torque, rel=1e-6, abs=1e-2)
    assert min(to_left, to_right) == pytest.approx(steering.back_pressure)


def test_stroke():
    """machine sheet 1.6: 0.386 m over 80 degrees; constructed to 2 %."""
    steering = load_machine("l60").steering
    stroke = length(steering, -steering.limit, 1) - length(steering, steering.limit, 1)
    assert stroke == pytest.approx(0.386, rel=0.02)


def test_steering_on_the_spot_shows_in_the_line_that_pushes():
    """Turning left against the tyres' scrub raises the pressure of the left line, turning right that of the other."""
    for rate, line in ((0.2, 0), (-0.2, 1)):
        plant = Plant(load_machine("l60"))
        plant.advance(Commands(brake_torque=(2e4,) * 4, articulation_rate=rate), 1.0)
        truth = plant.truth()
        assert truth.steering_pressure[line] > 1e6 + truth.steering_pressure[1 - line]
        assert truth.joint_torque * rate > 0.0
