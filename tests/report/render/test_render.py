"""The drawn machine: parts where the pose puts them, closed solids, arrows to scale, nothing hidden by mistake."""

from collections import Counter

import numpy as np
import pytest

from report.render.loader import FORCE, LIFTED, LOAD, METRES_PER_NEWTON, Dimensions, frames, machine_meshes
from report.render.pictures import clearance, dimensions_of
from report.render.solids import Pose, about_x, about_y, about_z, from_quaternion

D = Dimensions()
WORLD = Pose(np.zeros(3), np.eye(3))


def instant(**changes):
    still = {
        "position": np.array((0.0, 0.0, D.joint_height)),
        "attitude": np.array((1.0, 0.0, 0.0, 0.0)),
        "yaw": 0.0,
        "articulation_angle": 0.0,
        "oscillation_angle": 0.0,
        "lift_arm_angle": -0.6,
        "tilt_angle": 0.8,
        "normal_force": np.full(4, 29e3),
        "payload_mass": 0.0,
    }
    return {**still, **changes}


def rolled(angle):
    return np.array((np.cos(angle / 2), np.sin(angle / 2), 0.0, 0.0))


def wheel_centres(**changes):
    return np.array([pose.origin for pose in frames(instant(**changes), D).wheels])


def test_wheels_of_the_straight_machine():
    half = D.track / 2
    expected = [(1.5, half), (1.5, -half), (-1.5, half), (-1.5, -half)]
    np.testing.assert_allclose(wheel_centres(), [(x, y, D.wheel_height) for x, y in expected], atol=1e-12)


def test_articulation_to_the_left_moves_the_front_wheels_left():
    centres = wheel_centres(articulation_angle=0.5)
    middle = centres[:2].mean(axis=0)
    np.testing.assert_allclose(middle[:2], (1.5 * np.cos(0.5), 1.5 * np.sin(0.5)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(centres[0] - centres[1]), D.track)
    np.testing.assert_allclose(centres[2:], wheel_centres()[2:], atol=1e-12)


def test_left_side_up_lifts_the_left_wheels():
    centres = wheel_centres(attitude=rolled(0.3))
    np.testing.assert_allclose(centres[0, 2] - centres[1, 2], D.track * np.sin(0.3))
    np.testing.assert_allclose(centres[2, 2] - centres[3, 2], D.track * np.sin(0.3))


def test_an_axle_that_oscillates_against_the_roll_stays_level():
    """Rear frame rolled, rear axle turned back by as much: both rear wheels at one height."""
    centres = wheel_centres(attitude=rolled(0.1), oscillation_angle=-0.1)
    assert centres[2, 2] == pytest.approx(centres[3, 2])
    assert centres[0, 2] - centres[1, 2] == pytest.approx(D.track * np.sin(0.1))


def test_a_raised_arm_raises_the_bucket():
    low, high = (frames(instant(lift_arm_angle=a), D).bucket.origin[2] for a in (-0.6, 0.6))
    np.testing.assert_allclose(high - low, 2 * D.arm_length * np.sin(0.6))


def test_the_gap_below_a_wheel_is_its_height_less_its_radius():
    standing = clearance(instant(), D)
    np.testing.assert_allclose(standing, D.wheel_height - D.wheel_radius)
    raised = clearance(instant(position=np.array((0.0, 0.0, D.joint_height + 0.5))), D)
    np.testing.assert_allclose(np.subtract(raised, standing), 0.5)


def test_the_lowest_point_of_a_tilted_wheel_is_above_its_centre_less_its_radius():
    """A disc of radius R whose axle is inclined by 30 degrees reaches R cos 30 below its centre."""
    tilted = instant(attitude=rolled(np.pi / 6))
    heights = np.array([pose.origin[2] for pose in frames(tilted, D).wheels])
    np.testing.assert_allclose(heights - clearance(tilted, D), D.wheel_radius * np.cos(np.pi / 6))


def test_a_quaternion_gives_a_right_handed_rotation():
    q = np.array((0.5, -0.1, 0.7, 0.5))
    r = from_quaternion(q / np.linalg.norm(q))
    np.testing.assert_allclose(r @ r.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(r), 1.0)


@pytest.mark.parametrize(
    ("turn", "axis", "start", "end"),
    [
        (about_x, 1, (0, 1, 0), (0, 0, 1)),
        (about_y, 2, (1, 0, 0), (0, 0, -1)),
        (about_z, 3, (1, 0, 0), (0, 1, 0)),
    ],
)
def test_turns_are_right_handed(turn, axis, start, end):
    """A quarter turn left side up, nose down, to the left; and the same by quaternion."""
    np.testing.assert_allclose(turn(np.pi / 2) @ start, end, atol=1e-12)
    quaternion = np.zeros(4)
    quaternion[[0, axis]] = np.cos(0.2), np.sin(0.2)
    np.testing.assert_allclose(turn(0.4), from_quaternion(quaternion), atol=1e-12)


def of_colour(meshes, colour):
    return [mesh for mesh in meshes if mesh.colour == colour]


def test_a_wheel_without_load_is_coloured_and_has_no_arrow():
    standing = machine_meshes(instant(), D)
    lifted = machine_meshes(instant(normal_force=np.array((0.0, 50e3, 30e3, 30e3))), D)
    assert not of_colour(standing, LIFTED)
    (wheel, *lugs) = of_colour(lifted, LIFTED)
    np.testing.assert_allclose(wheel.corners.mean(axis=(0, 1))[:2], (1.5, D.track / 2), atol=0.02)
    assert lugs
    per_arrow = len(of_colour(standing, FORCE)) // 4
    assert len(of_colour(lifted, FORCE)) == 3 * per_arrow


@pytest.mark.parametrize("force", [2e3, 30e3, 90e3])
def test_an_arrow_is_as_long_as_the_force(force):
    arrows = of_colour(machine_meshes(instant(normal_force=np.full(4, force)), D), FORCE)
    corners = np.concatenate([mesh.corners.reshape(-1, 3) for mesh in arrows])
    assert np.ptp(corners[:, 2]) == pytest.approx(force * METRES_PER_NEWTON)


def test_payload_is_shown_when_there_is_some():
    assert not of_colour(machine_meshes(instant(), D), LOAD)
    assert of_colour(machine_meshes(instant(payload_mass=1.0), D), LOAD)


def test_every_solid_is_closed():
    """Each edge belongs to exactly two triangles: no hole through which the inside shows."""
    for mesh in machine_meshes(instant(payload_mass=500.0), D):
        corners = np.round(mesh.corners, 6)
        edges = Counter(
            frozenset((tuple(triangle[i]), tuple(triangle[i - 1]))) for triangle in corners for i in range(3)
        )
        assert {count for edge, count in edges.items() if len(edge) == 2} == {2}


def test_a_box_is_where_it_was_put():
    corners = WORLD.box((1, 2, 3), (0.5, 0.25, 2), (1, 1, 1)).corners.reshape(-1, 3)
    np.testing.assert_allclose(corners.min(axis=0), (0.5, 1.75, 1))
    np.testing.assert_allclose(corners.max(axis=0), (1.5, 2.25, 5))


def test_a_ring_turns_about_y():
    corners = WORLD.ring((0.5, 0.7), (-0.1, 0.3), 64, (1, 1, 1)).corners.reshape(-1, 3)
    radius = np.hypot(corners[:, 0], corners[:, 2])
    np.testing.assert_allclose(radius[corners[:, 1] < 0], 0.5)
    np.testing.assert_allclose(radius[corners[:, 1] > 0], 0.7)
    assert set(np.round(corners[:, 1], 12)) == {-0.1, 0.3}


def test_dimensions_follow_the_machine_file():
    from plant.sheets.machine import load_machine

    machine, drawn = load_machine("l60"), dimensions_of("l60")
    assert drawn.track == machine.geometry.track
    assert drawn.wheel_radius == machine.tyre.radius


def test_an_unknown_machine_is_drawn_with_typical_dimensions():
    assert dimensions_of("no such machine") == Dimensions()
