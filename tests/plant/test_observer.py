"""What sensors can know of the truth: inclination by accelerometers, torque of a wheel that its brake holds."""

import math

import numpy as np
import pytest

from plant.physics.surface import Surface
from plant.plant import Commands, Plant
from plant.sheets.machine import load_machine

MACHINE = load_machine("l60")
HELD = Commands(brake_torque=(12e3,) * 4)
NOTHING = Commands()


def test_at_rest_accelerometers_show_the_slope():
    plant = Plant(MACHINE, Surface(grade=math.atan(0.2), bank=math.radians(8.0)))
    plant.advance(HELD, 5.0)  # damps the rocking on the tyres: 1.6 Hz, damping ratio 0.05
    truth = plant.truth()
    assert min(abs(truth.pitch), abs(truth.roll)) > 0.1
    np.testing.assert_allclose(truth.inclination, [truth.pitch, truth.roll], rtol=0, atol=2e-3)


def test_in_an_even_turn_accelerometers_lean_by_the_centripetal_acceleration():
    """tan of the apparent roll against the frame is a_y / g on level ground."""
    plant = Plant(MACHINE, speed=3.0, articulation_angle=0.4)
    plant.advance(NOTHING, 2.0)
    truth = plant.truth()
    across = truth.angular_velocity[2] * truth.speed
    assert across > 0.8
    assert truth.inclination[1] - truth.roll == pytest.approx(math.atan(across / 9.81), abs=0.01)


def test_the_torque_that_is_known_of_a_held_wheel_is_the_drives():
    """The brakes hold the machine on the slope; what they bear follows from no pressure."""
    plant = Plant(MACHINE, Surface(grade=math.atan(0.2)))
    plant.advance(HELD, 2.0)
    truth = plant.truth()
    np.testing.assert_array_equal(truth.wheel_speed, np.zeros(4))
    assert abs(truth.wheel_torque.sum()) > 10e3  # 11 t on 20 % at a radius of 0.7 m
    np.testing.assert_array_equal(truth.known_torque, np.zeros(4))


def test_the_torque_of_a_wheel_that_turns_is_known():
    plant = Plant(MACHINE, speed=4.0)
    plant.advance(Commands(brake_torque=(2e3,) * 4), 0.3)
    truth = plant.truth()
    assert (truth.wheel_speed > 1.0).all()
    np.testing.assert_array_equal(truth.known_torque, truth.wheel_torque)
    np.testing.assert_allclose(truth.known_torque, -2e3, rtol=0.01)  # 0.3 s: six lags of the brake
