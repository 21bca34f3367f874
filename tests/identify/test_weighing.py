"""Weighings: a two-body machine on an oscillating axle, solved by its own balances, is recovered."""

import numpy as np
import pytest

from identify.machine.weighing import G, Geometry, Weighing, positions, weighed

GEOMETRY = Geometry(front=1.5, rear=1.5, track=1.93)
FRONT, REAR = (4382.0, 1.25, 1.0), (7460.0, -1.24, 1.17)  # mass [kg], x from the joint [m], height [m]


def loads(articulation, grade=0.0, bank=0.0):
    """Four loads of a standing machine: three balances, and equal loads on the axle that oscillates."""
    (mf, xf, zf), (mr, xr, zr) = FRONT, REAR
    m, down = mf + mr, G * np.cos(grade) * np.cos(bank)
    height = mf * zf + mr * zr
    place = positions(GEOMETRY, articulation)
    A = np.array([np.ones(4), place[:, 0], place[:, 1], [0.0, 0.0, 1.0, -1.0]])
    b = [
        m * down,
        down * (mr * xr + mf * xf * np.cos(articulation)) - G * np.sin(grade) * height,
        down * mf * xf * np.sin(articulation) - G * np.sin(bank) * height,
        0.0,
    ]
    return np.linalg.solve(A, b)


def sweep(random, slopes=(0.0,), angles=(-0.6, -0.3, 0.0, 0.3, 0.6), sd=50.0):
    return [
        Weighing(loads=loads(a, g) + sd * random.standard_normal(4), articulation=a, grade=g)
        for a in angles
        for g in slopes
    ]


def test_masses_moments_and_height_are_recovered():
    random = np.random.default_rng(1)
    found = weighed(sweep(random, (-0.12, 0.0, 0.12)), GEOMETRY, 50.0)
    wanted = [11842.0, 7460.0 * -1.24, 4382.0 * 1.25, 4382.0 * 1.0 + 7460.0 * 1.17]
    assert np.all(np.abs(found.value[:4] - wanted) < 3.5 * found.sd[:4])
    assert found.height == pytest.approx(wanted[3] / wanted[0], rel=0.03)
    assert found.undetermined == ()


def test_level_ground_leaves_the_height_open_and_names_the_slope():
    found = weighed(sweep(np.random.default_rng(2)), GEOMETRY, 50.0)
    names = dict(found.undetermined)
    assert "grade" in names["height moment"]
    assert "mass" not in names


def test_a_straight_machine_leaves_both_frames_open():
    found = weighed([Weighing(loads=loads(0.0))] * 3, GEOMETRY, 50.0)
    assert {"rear moment", "front moment"} <= set(dict(found.undetermined))


def test_intervals_hold_in_95_of_100_draws():
    wanted = np.array([11842.0, 7460.0 * -1.24, 4382.0 * 1.25])
    inside = 0
    for seed in range(100):
        found = weighed(sweep(np.random.default_rng(seed)), GEOMETRY, 50.0)
        inside += int(np.count_nonzero(np.abs(found.value[:3] - wanted) < 1.96 * found.sd[:3]))
    assert inside >= 0.93 * 300


def test_a_weighing_with_a_wrong_angle_is_named():
    rows = sweep(np.random.default_rng(3))
    rows[1] = Weighing(loads=rows[1].loads, articulation=0.45)
    assert 2 in weighed(rows, GEOMETRY, 50.0).odd


def test_a_negative_load_is_refused():
    with pytest.raises(ValueError, match="zeroed under load"):
        weighed([Weighing(loads=np.array([1.0, 2.0, -3.0, 4.0]))], GEOMETRY, 50.0)
