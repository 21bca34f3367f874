"""The height of the ground under each wheel by the equation of its profile."""

import math

import numpy as np
import pytest

from plant.physics import state as s
from plant.plant import Plant
from tests.plant.effects.trial import L60, evaluated, machine

AXLES = np.array((L60.geometry.front_axle_x,) * 2 + (L60.geometry.rear_axle_x,) * 2)
PLACE_M = 5e-3  # the standing machine is a little pitched, so that its wheels are not quite below their axles' places


def heights(given, **turned):
    """Height of the ground under the four wheels of a machine with its joint above the origin [m]."""
    plant = Plant(given, speed=1.0)
    for wheel, angle in turned.items():
        plant._state[s.JOINT + s.WHEEL + int(wheel[-1])] = angle
    return evaluated(plant).work.ground[:, s.G_HEIGHT].copy()


@pytest.mark.parametrize("begins", [1.2, 1.4])
@pytest.mark.parametrize("length", [0.5, 1.0])
@pytest.mark.parametrize(("left", "right"), [(0.1, 0.1), (0.12, 0.05)])
def test_a_kerb_rises_by_half_a_cosine(begins, length, left, right):
    """h (1 - cos(pi s/l))/2 under the front wheels; the rear ones have not come to it."""
    found = heights(machine("kerb", distance_m=begins, length_m=length, left_m=left, right_m=right))
    part = (AXLES[0] - begins) / length
    share = (1.0 - math.cos(math.pi * part)) / 2.0
    slack = PLACE_M * math.pi / (2.0 * length)
    np.testing.assert_allclose(found, (left * share, right * share, 0.0, 0.0), atol=slack * max(left, right))


@pytest.mark.parametrize("begins", [0.9, 1.3])
@pytest.mark.parametrize("length", [1.5, 2.5])
@pytest.mark.parametrize(("left", "right"), [(0.1, 0.04), (-0.08, 0.06)])
def test_a_ditch_is_a_cosine_down_and_up_again(begins, length, left, right):
    """-d (1 - cos(2 pi s/l))/2; negative: a bump."""
    found = heights(machine("ditch", distance_m=begins, length_m=length, left_m=left, right_m=right))
    share = (1.0 - math.cos(math.tau * (AXLES[0] - begins) / length)) / 2.0
    slack = PLACE_M * math.pi / length
    np.testing.assert_allclose(
        found, (-left * share, -right * share, 0.0, 0.0), atol=slack * max(abs(left), abs(right))
    )


@pytest.mark.parametrize("amplitude", [5.0, 20.0])
@pytest.mark.parametrize("wavelength", [2.0, 3.7])
def test_a_washboard_is_a_sine_of_the_place(amplitude, wavelength):
    found = heights(machine("washboard", amplitude_mm=amplitude, wavelength_m=wavelength))
    slack = PLACE_M * math.tau / wavelength
    np.testing.assert_allclose(
        found,
        1e-3 * amplitude * np.sin(math.tau * AXLES / wavelength),
        atol=slack * 1e-3 * amplitude,
    )


@pytest.mark.parametrize("amplitude", [0.5, 2.0])
@pytest.mark.parametrize("lugs", [20.0, 23.0])
def test_lugs_are_a_sine_of_the_wheels_own_angle(amplitude, lugs):
    found = heights(
        machine("lug_excitation", amplitude_mm=amplitude, lugs=lugs),
        wheel_0=0.02,
        wheel_1=0.05,
        wheel_3=-0.03,
    )
    expected = 1e-3 * amplitude * np.sin(lugs * np.array((0.02, 0.05, 0.0, -0.03)))
    np.testing.assert_allclose(found, expected, atol=1e-12)
