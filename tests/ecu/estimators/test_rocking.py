"""Heave, pitch and roll of a bent machine on its tyres, against equations set up another way."""

import math

import numpy as np
import pytest
from scipy.linalg import eigh, null_space

from ecu.calibration import load_calibration
from ecu.estimators.joint import joint_at
from ecu.estimators.loads.cog import front_unit
from ecu.estimators.quantities import NormalForces
from ecu.estimators.stability.rocking import restoring_matrix, rocked, rocking_from, with_rocking
from ecu.estimators.stability.rollover import loaded_machine

P = load_calibration().parameters
G = 9.81
ANGLES = (-0.6, -0.2, 0.0, 0.35, 0.65)
RESTING = NormalForces(5e4, 5e4, 2e4, 2e4, 2e4)
WEIGHT = 1.6e5


def machine(arm=0.5, payload=3204.0, **prediction):
    given = P._replace(prediction=P.prediction._replace(**prediction))
    return loaded_machine(front_unit(arm, 0.2, payload, P.front, P.arm, P.bucket), payload, given)


def matrix(angle, m):
    """The restoring matrix, rows and columns left, right, rear."""
    return np.array(restoring_matrix(joint_at(angle), m)[:9]).reshape(3, 3)


def velocity(point):
    """Velocity of a point from that of the joint's origin and the angular rates (3, 6)."""
    x, y, z = point
    return np.hstack([np.eye(3), [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]])


def modes(angle, m):
    """The same machine as a body with six freedoms and three constraints: squares of its natural frequencies [1/s2], loads of its modes.

    The constraints are the module's: the rear axle's contact stays along x, the pivot along y, the front axle's middle along its own y.
    """
    g, c, s = m.geometry, math.cos(angle), math.sin(angle)
    turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    tensors = [
        turned @ np.diag([m.front.roll_inertia, m.front.pitch_inertia, m.front.yaw_inertia]) @ turned.T,
        np.diag([m.rear.roll_inertia, m.rear.pitch_inertia, m.rear.yaw_inertia]),
    ]
    places = [(m.front.x * c, m.front.x * s, m.front.z), (m.rear.x, 0.0, m.rear.z)]
    mass = np.zeros((6, 6))
    for weight, place, tensor in zip((m.front.mass, m.rear.mass), places, tensors, strict=True):
        mass += weight * velocity(place).T @ velocity(place)
        mass[3:, 3:] += tensor
    axle = velocity((-g.rear_length, 0.0, m.axle.height))
    axle[1] = 0.0  # it stays with the road while the frame rolls
    mass += m.axle.mass * axle.T @ axle
    kept = np.array([
        velocity((-g.rear_length, 0.0, 0.0))[0],
        velocity((-g.rear_length, 0.0, g.pivot_height))[1],
        np.array([-s, c, 0.0]) @ velocity((g.front_length * c, g.front_length * s, 0.0)),
    ])  # fmt: skip
    free = null_space(kept)
    half, k = g.front_track / 2.0, m.prediction.tyre_stiffness
    points = [
        (g.front_length * c - half * s, g.front_length * s + half * c, 0.0),
        (g.front_length * c + half * s, g.front_length * s - half * c, 0.0),
        (-g.rear_length, 0.0, 0.0),
    ]
    stiffness = sum(
        size * np.outer(velocity(point)[2], velocity(point)[2])
        for size, point in zip((k, k, 2.0 * k), points, strict=True)
    )
    # the motion that is a roll alone: by it every lump leans sideways, and its weight tips the machine further
    heave, roll, pitch = np.eye(6)[2], np.eye(6)[3], np.eye(6)[4]
    rolled = np.linalg.solve(np.vstack([kept, heave, roll, pitch]), [0.0, 0.0, 0.0, 0.0, 1.0, 0.0])
    tipping = -G * sum(
        weight * (velocity(place) @ rolled)[1]
        for weight, place in zip((m.front.mass, m.rear.mass), places, strict=True)
    )
    stiffness = stiffness - tipping * np.outer(roll, roll)
    squares, shapes = eigh(free.T @ stiffness @ free, free.T @ mass @ free)
    loads = [size * velocity(point)[2] @ free for size, point in zip((k, k, 2.0 * k), points, strict=True)]
    return squares, np.array(loads) @ shapes


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize(("arm", "payload"), [(-0.6, 0.0), (0.5, 3204.0), (0.8, 1500.0)])
def test_the_modes_are_those_of_a_constrained_body(angle, arm, payload):
    """Frequencies and shapes; a shape is told by the loads of its tyres."""
    m = machine(arm, payload)
    squares, loads = modes(angle, m)
    size = np.abs(loads).max(axis=0)
    assert matrix(angle, m) @ loads / size == pytest.approx(squares * loads / size, rel=1e-6, abs=1e-6)


def test_a_straight_machine_rolls_about_the_line_from_its_front_axle_to_the_pivot():
    """And neither heaves nor pitches by it."""
    m = machine()
    g, half = m.geometry, m.geometry.front_track / 2.0
    high = [
        body.z - g.pivot_height / (g.front_length + g.rear_length) * (g.front_length - body.x)
        for body in (m.front, m.rear)
    ]
    inertia = m.front.roll_inertia + m.rear.roll_inertia
    inertia += m.front.mass * high[0] ** 2 + m.rear.mass * high[1] ** 2
    inertia += (m.front.yaw_inertia + m.rear.yaw_inertia) * (
        g.pivot_height / (g.front_length + g.rear_length)
    ) ** 2
    weight = G * (m.front.mass * high[0] + m.rear.mass * high[1])
    squared = (2.0 * m.prediction.tyre_stiffness * half**2 - weight) / inertia
    assert matrix(0.0, m) @ [1.0, -1.0, 0.0] == pytest.approx([squared, -squared, 0.0], rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("angle", [0.2, 0.65])
def test_bent_to_the_other_side_left_and_right_change_places(angle):
    swap = [1, 0, 2]
    m = machine()
    assert matrix(-angle, m) == pytest.approx(matrix(angle, m)[np.ix_(swap, swap)], rel=1e-9)


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("mode", range(3))
def test_a_step_along_a_mode_swings_to_twice_its_size_in_half_a_period(angle, mode):
    """Undamped; to the error of the step in time, a hundredth of the period."""
    m = machine(roll_damping=0.0)
    squares, shapes = np.linalg.eig(matrix(angle, m))
    step = 5e3 * shapes[:, mode].real
    pushed = NormalForces(5e4 + step[0], 5e4 + step[1], 2e4 + step[2], 2e4 + step[2] / 2, 2e4 + step[2] / 2)
    restoring, dt = (
        restoring_matrix(joint_at(angle), m),
        2.0 * math.pi / math.sqrt(squares[mode].real) / 100.0,
    )
    now, seen = rocking_from(5e4, 5e4, 4e4, 0.0, 0.0, RESTING, WEIGHT), []
    for _ in range(100):
        now = rocked(now, pushed, dt, restoring)
        n = with_rocking(pushed, now)
        seen.append((n.front_left - 5e4, n.front_right - 5e4, n.rear_left + n.rear_right - 4e4))
    assert seen[49] == pytest.approx(2.0 * step, abs=200.0)
    assert seen[99] == pytest.approx([0.0, 0.0, 0.0], abs=400.0)


@pytest.mark.parametrize("angle", ANGLES)
def test_with_damping_every_swing_ends_where_the_loads_rest(angle):
    restoring = restoring_matrix(joint_at(angle), machine())
    now = rocking_from(7e4, 4e4, 3e4, 2e5, -1e5, RESTING, WEIGHT)
    for _ in range(10000):
        now = rocked(now, RESTING, 0.01, restoring)
    assert tuple(with_rocking(RESTING, now)) == pytest.approx(tuple(RESTING), abs=10.0)


def test_loads_that_do_not_change_do_not_swing():
    now = rocking_from(5e4, 5e4, 4e4, 0.0, 0.0, RESTING, WEIGHT)
    restoring = restoring_matrix(joint_at(0.4), machine())
    for _ in range(10):
        now = rocked(now, RESTING, 0.04, restoring)
    assert with_rocking(RESTING, now) == RESTING


def test_what_tilting_gives_the_front_wheels_the_rear_ones_lose():
    now = rocking_from(5e4, 5e4, 4e4, 2e5, -5e4, RESTING, WEIGHT)
    assert (now.left_rate, now.right_rate) == (2e5, -5e4)
    assert now.left_rate + now.right_rate + now.rear_rate == 0.0


@pytest.mark.parametrize("mode", range(3))
def test_a_swing_fades_by_the_damping_of_its_frequency(mode):
    """Damping in proportion to stiffness: a mode of frequency w has the ratio roll_damping w / pitch_frequency. Five periods of 500 steps."""
    angle, m = 0.35, machine()
    squares, loads = modes(angle, m)
    frequency, shape = math.sqrt(squares[mode]), 5e3 * loads[:, mode] / np.abs(loads[:, mode]).max()
    ratio = m.prediction.roll_damping * frequency / m.pitch_frequency
    restoring, dt = restoring_matrix(joint_at(angle), m), 2.0 * math.pi / frequency / 500.0
    start = 5e4 + shape[0], 5e4 + shape[1], 4e4 + shape[2]
    now, seen = rocking_from(*start, 0.0, 0.0, RESTING, WEIGHT), []
    for _ in range(2500):
        now = rocked(now, RESTING, dt, restoring)
        seen.append(abs(np.array(now[:3]) @ shape) / (shape @ shape))
    assert max(seen[2400:]) == pytest.approx(math.exp(-ratio * 10.0 * math.pi), rel=0.1)
