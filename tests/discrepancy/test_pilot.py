"""Where the pilot is when a run-in begins, and what comes of it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from discrepancy.models import pilot
from discrepancy.models.shared_out import Way
from plant import state as s
from plant.effects import find_effect
from plant.follow import M_ARTICULATION, M_SPEED, M_TURNING, MEASURED
from plant.machine import load_machine

L60 = load_machine("l60")
ANGLE, TURNING, STEP_S = 0.4, 2.5, 0.01
AHEAD, BEHIND = L60.geometry.front_axle_x, -L60.geometry.rear_axle_x


def circling(seconds: float) -> Way:
    """Wheels that roll evenly with the joint held at an angle."""
    measured = np.zeros((round(seconds / STEP_S), MEASURED))
    measured[:, M_SPEED] = TURNING
    measured[:, M_TURNING : M_TURNING + 4] = TURNING
    measured[:, M_ARTICULATION] = ANGLE
    return Way(measured, {}, np.array([0, len(measured)]), (False, False, False), 0.0, STEP_S)


def heading(state: np.ndarray) -> float:
    w, x, y, z = state[s.ATTITUDE : s.ATTITUDE + 4]
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


@pytest.mark.parametrize("gyro", [False, True])
def test_dead_reckoning_of_a_circle_is_that_circle(gyro):
    """Both axles point at its centre: the rear one is as far from it as ahead / sin + behind / tan of the angle."""
    way = circling(30.0)
    speed = pilot.ROLLED * L60.tyre.radius * TURNING
    radius = AHEAD / math.sin(ANGLE) + BEHIND / math.tan(ANGLE)
    rate = np.full(len(way.measured), speed / radius) if gyro else None
    along, across, turned = pilot.reckoned(L60, way.measured, STEP_S, rate).T
    assert turned[-1] == pytest.approx(speed / radius * (30.0 - STEP_S))
    centre = (-BEHIND, radius)  # the joint begins at the origin, ahead of the rear axle
    away = np.hypot(along - centre[0], across - centre[1])
    np.testing.assert_allclose(away, math.hypot(BEHIND, radius), rtol=2e-6)  # trapezoids of 10 ms


def test_after_a_run_in_it_points_where_it_would_after_the_whole_way(monkeypatch):
    """On a slope that matters: without it, what pulls a machine back would pull it aside."""
    sloping = replace(L60, effects=(find_effect("grade").of(grade_deg=0.3, bank_deg=0.2),))
    way = circling(40.0)
    arrived = []
    for run_in_s in (pilot.RUN_IN_S, 1e3):
        monkeypatch.setattr(pilot, "RUN_IN_S", run_in_s)
        arrived.append(pilot.flown(sloping, {}, way, [2300], {}))
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
def test_it_points_where_the_gyro_says(off):
    """What a machine misses of the road turns it otherwise; a slope must pull it where the recorded one was."""
    way = circling(10.0)
    turning = np.full(len(way.measured), 0.15 + off)
    (state,) = pilot.flown(L60, {}, way, [900], {}, turning)
    assert heading(state) == pytest.approx(math.remainder(9.0 * (0.15 + off), math.tau), abs=1e-6)
    (free,) = pilot.flown(L60, {}, way, [900], {})
    drift, free_drift = (math.atan2(x[s.VELOCITY + 1], x[s.VELOCITY]) - heading(x) for x in (state, free))
    assert math.remainder(drift - free_drift, math.tau) == pytest.approx(0.0, abs=1e-6)
    joints = slice(s.JOINT + s.FRONT_FRAME, s.JOINT + s.BODIES)
    np.testing.assert_allclose(state[joints], free[joints])


def test_what_rests_are_kept_for_one_machine_changes_nothing_for_another():
    """They are shared by pilots that fly side by side; a machine that begins with the recording begins at its own rest."""
    way, heavier = (
        circling(20.0),
        replace(L60, rear_frame=replace(L60.rear_frame, mass=L60.rear_frame.mass + 900.0)),
    )
    kept: dict[int, np.ndarray] = {}
    for rows in ([900], [1900]):  # from the first row, and after a run-in
        pilot.flown(L60, {}, way, rows, kept)
    assert 0 not in kept
    np.testing.assert_array_equal(
        pilot.flown(heavier, {}, way, [900], kept), pilot.flown(heavier, {}, way, [900], {})
    )
