"""A joint's cosine and sine: those of a slight turn are a rotation, and the right one."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ecu.estimators.joint import joint_at, slight, turned


@settings(deadline=None)  # the first example compiles
@given(st.floats(-0.1, 0.1))
def test_a_slight_turn_is_a_rotation_by_its_angle(angle):
    c, s = slight(angle)
    assert c * c + s * s == pytest.approx(1.0, abs=1e-15)
    assert math.atan2(s, c) == pytest.approx(angle, abs=abs(angle) ** 5 / 120.0 + 1e-16)


def test_thirty_steps_lead_to_where_one_turn_does():
    """The quickest motion, the bucket's: 1.4 rad/s for 1.2 s."""
    joint = joint_at(-0.8)
    for k in range(1, 31):
        joint = turned(joint, -0.8 + 0.056 * k)
    assert joint == pytest.approx(joint_at(-0.8 + 0.056 * 30), abs=2e-7)
