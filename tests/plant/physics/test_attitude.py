"""Attitudes of starts: scipy's rotations to the bit, and laws that hold for any."""

import math
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from plant.physics import attitude

angles = st.floats(-math.pi, math.pi)
quaternions = st.integers(0, 2**32).map(
    lambda seed: tuple(Rotation.random(rng=seed).as_quat(scalar_first=True).tolist())
)


def scipys(quaternion):
    return Rotation.from_quat(quaternion, scalar_first=True)


@given(angles, angles, angles)
def test_angles_are_those_of_scipy(yaw, pitch, roll):
    expected = Rotation.from_euler("ZYX", (yaw, pitch, roll)).as_quat(scalar_first=True)
    assert attitude.of_angles(yaw, pitch, roll) == pytest.approx(expected, abs=1e-15)


@given(quaternions, quaternions)
def test_products_are_those_of_scipy(p, q):
    expected = (scipys(p) * scipys(q)).as_quat(scalar_first=True)
    assert attitude.product(p, q) == pytest.approx(expected, abs=1e-15)


@given(quaternions)
def test_axes_give_back_the_attitude_they_came_from(q):
    """Up to the sign of all four, which is the same attitude; each of the four may be the largest."""
    found = np.array(attitude.of_axes(scipys(q).as_matrix()))
    assert abs(found @ np.array(q)) == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("angle", [0.0, 1e-12, 0.9999e-3, 1.0001e-3, 1.0, math.pi])
def test_a_turn_about_an_axis_is_the_half_angle(axis, angle):
    vector = np.zeros(3)
    vector[axis] = angle
    expected = [math.cos(angle / 2.0), 0.0, 0.0, 0.0]
    expected[1 + axis] = math.sin(angle / 2.0)
    assert attitude.of_turn(vector) == pytest.approx(expected, rel=1e-14, abs=1e-16)


@given(quaternions, st.floats(0.1, 10.0))
def test_a_length_is_no_part_of_an_attitude(q, length):
    assert attitude.unit(*(length * part for part in q)) == pytest.approx(q, abs=1e-15)


def test_a_bench_starts_without_scipys_packages():
    """Rotations pulled in its sparse matrices and k-d trees, a fifth of the start of every process. numba loads its root."""
    code = (
        "import sys, hil.compose; sys.exit('scipy.spatial' in sys.modules or 'scipy.sparse' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
