"""Angles that start again after a turn."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.checks.wrapped import wrapped
from discrepancy.signals.recording import Array, Recording, signal
from tests.discrepancy.toys import tank

MODEL = replace(tank(), outputs={"heading": "rad", "rate": "rad/s"})
TIME_S = 0.1 * np.arange(300)
TURNING = 0.5 * TIME_S  # two turns and a half in 30 s


def complaints(heading: Array) -> list[str]:
    signals = {"heading": signal(TIME_S, heading, "rad"), "rate": signal(TIME_S, heading, "rad/s")}
    return [c.described for c in wrapped(MODEL, Recording("r", signals))]


@pytest.mark.parametrize("middle", [0.0, np.pi])
def test_a_compass_that_starts_again_is_said_with_its_times(middle: float) -> None:
    """From -180 to 180 degrees, and from 0 to 360."""
    compass = (TURNING - middle + np.pi) % (2.0 * np.pi) + middle - np.pi
    (said,) = complaints(compass)
    assert said.startswith("r: heading jumps by a whole turn at ")
    first = TIME_S[1 + int(np.argmax(np.abs(np.diff(compass))))]
    assert f"{first:.3g}" in said


def test_angles_that_grow_and_angles_that_jump_by_less_are_none() -> None:
    assert complaints(TURNING) == []
    assert complaints(np.where(TIME_S > 10.0, 3.0, 0.0)) == []
