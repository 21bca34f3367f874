"""Warm-up runs: where they start, and which state they end in."""

import math
from dataclasses import replace

import numpy as np
import pytest

from discrepancy.models.loader import warm_up
from discrepancy.models.loader.replay_inputs import ReplayInputs
from plant.effects import find_effect
from plant.physics import state as s
from plant.replay import M_ARTICULATION, M_SPEED, M_TORQUE, M_TURNING, MEASURED
from plant.sheets.machine import load_machine

L60 = load_machine("l60")
ANGLE, TURNING, STEP_S = 0.4, 2.5, 0.01
AHEAD, BEHIND = L60.geometry.front_axle_x, -L60.geometry.rear_axle_x


def circling(seconds: float) -> ReplayInputs:
    """Wheels that roll evenly with the joint held at an angle."""
    measured = np.zeros((round(seconds / STEP_S), MEASURED))
    measured[:, M_SPEED] = TURNING
    measured[:, M_TURNING : M_TURNING + 4] = TURNING
    measured[:, M_ARTICULATION] = ANGLE
    return ReplayInputs(
        measured,
        {},
        np.array([0, len(measured)]),
        (False, False, False),
        0.0,
        STEP_S,
        np.zeros((len(measured), 2)),
    )


def heading(state: np.ndarray) -> float:
    w, x, y, z = state[s.ATTITUDE : s.ATTITUDE + 4]
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


@pytest.mark.parametrize("gyro", [False, True])
def test_dead_reckoning_of_a_circle_is_that_circle(gyro):
    """Both axles point at its centre: the rear one is as far from it as ahead / sin + behind / tan of the angle."""
    inputs = circling(30.0)
    speed = warm_up.ROLLING_RADIUS * L60.tyre.radius * TURNING
    radius = AHEAD / math.sin(ANGLE) + BEHIND / math.tan(ANGLE)
    rate = np.full(len(inputs.measured), speed / radius) if gyro else None
    along, across, turned = warm_up.dead_reckoning(L60, inputs.measured, STEP_S, rate).T
    assert turned[-1] == pytest.approx(speed / radius * (30.0 - STEP_S))
    centre = (-BEHIND, radius)  # the joint begins at the origin, ahead of the rear axle
    away = np.hypot(along - centre[0], across - centre[1])
    np.testing.assert_allclose(away, math.hypot(BEHIND, radius), rtol=2e-6)  # trapezoids of 10 ms


def test_a_short_warm_up_ends_like_one_over_the_whole_recording(monkeypatch):
    """On a slope, where the heading matters: a wrong one would turn the slope's pull sideways."""
    sloping = replace(L60, effects=(find_effect("grade").of(grade_deg=0.3, bank_deg=0.2),))
    inputs = circling(40.0)
    arrived = []
    for warm_up_s in (warm_up.WARM_UP_S, 1e3):
        monkeypatch.setattr(warm_up, "WARM_UP_S", warm_up_s)
        arrived.append(warm_up.warm_up(sloping, {}, inputs, [2300], {})[0])
    brief, whole = (states[0] for states in arrived)
    assert abs(heading(whole)) > 0.5
    assert abs(math.remainder(heading(brief) - heading(whole), math.tau)) < 0.2
    np.testing.assert_allclose(
        brief[s.POSITION : s.POSITION + 2], whole[s.POSITION : s.POSITION + 2], atol=1.0
    )
    np.testing.assert_allclose(
        brief[s.VELOCITY : s.VELOCITY + 3], whole[s.VELOCITY : s.VELOCITY + 3], atol=0.2
    )
    np.testing.assert_allclose(brief[s.ANGULAR : s.ANGULAR + 3], whole[s.ANGULAR : s.ANGULAR + 3], atol=0.02)


@pytest.mark.parametrize("off", [0.0, 0.3])
def test_the_heading_is_that_of_the_gyro(off):
    """Unknown forces of the road turn the real machine; a slope has to pull the replayed one in the recorded direction."""
    inputs = circling(10.0)
    turning = np.full(len(inputs.measured), 0.15 + off)
    (state,), _ = warm_up.warm_up(L60, {}, inputs, [900], {}, turning)
    assert heading(state) == pytest.approx(math.remainder(9.0 * (0.15 + off), math.tau), abs=1e-6)
    (free,), _ = warm_up.warm_up(L60, {}, inputs, [900], {})
    drift, free_drift = (math.atan2(x[s.VELOCITY + 1], x[s.VELOCITY]) - heading(x) for x in (state, free))
    assert math.remainder(drift - free_drift, math.tau) == pytest.approx(0.0, abs=1e-6)
    joints = slice(s.JOINT + s.FRONT_FRAME, s.JOINT + s.BODIES)
    np.testing.assert_allclose(state[joints], free[joints])


def test_a_run_that_diverges_is_not_a_number_from_there_on():
    """A search tries effects of any size, and such a start must not end the diagnosis."""
    inputs = circling(20.0)
    inputs.measured[1000:, M_TORQUE : M_TORQUE + 4] = 1e30
    (before, after), _ = warm_up.warm_up(L60, {}, inputs, [900, 1900], {}, np.full(len(inputs.measured), 0.1))
    assert np.isfinite(before).all()
    assert np.isnan(after).all()


def test_equilibria_cached_for_one_machine_change_nothing_for_another():
    """Parallel warm-up runs share the cache; one from the first row starts at the machine's own equilibrium."""
    inputs, heavier = (
        circling(20.0),
        replace(L60, rear_frame=replace(L60.rear_frame, mass=L60.rear_frame.mass + 900.0)),
    )
    kept: dict[int, np.ndarray] = {}
    for rows in ([900], [1900]):  # from the first row, and after a warm-up run
        warm_up.warm_up(L60, {}, inputs, rows, kept)
    assert 0 not in kept
    np.testing.assert_array_equal(
        warm_up.warm_up(heavier, {}, inputs, [900], kept)[0],
        warm_up.warm_up(heavier, {}, inputs, [900], {})[0],
    )


def test_a_levelled_sensor_arrives_with_the_lean_of_the_drive_before():
    """In an even turn that of its centripetal acceleration; a sensor that its accelerometers do not level has none."""
    inputs = circling(20.0)
    states, leans = warm_up.warm_up(L60, {}, inputs, [1900], {}, levelling_s=(math.inf, 1.0))
    turning = states[0, s.ANGULAR + 2]
    radius = AHEAD / math.sin(ANGLE) + BEHIND / math.tan(ANGLE)
    assert leans[0, 0] == 0.0
    assert leans[0, 1] == pytest.approx(math.atan(turning**2 * radius / 9.81), rel=0.05)
