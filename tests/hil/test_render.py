"""Pictures: parts where the pose puts them, and never a blank."""

import io

import matplotlib.image
import numpy as np
import pytest

from hil.render import dimensions_of, engine, painter, scene_of
from hil.render.shapes import LIFTED, Dimensions, frames, from_quaternion, machine_shapes

D = Dimensions()


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


def test_wheels_of_the_straight_machine():
    centres = frames(instant(), D).wheel_centres(D)
    half = D.track / 2
    expected = [(1.5, half), (1.5, -half), (-1.5, half), (-1.5, -half)]
    np.testing.assert_allclose(centres, [(x, y, D.wheel_height) for x, y in expected], atol=1e-12)


def test_articulation_to_the_left_moves_the_front_wheels_left():
    centres = frames(instant(articulation_angle=0.5), D).wheel_centres(D)
    middle = centres[:2].mean(axis=0)
    np.testing.assert_allclose(middle[:2], (1.5 * np.cos(0.5), 1.5 * np.sin(0.5)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(centres[0] - centres[1]), D.track)


def test_left_side_up_lifts_the_left_wheels():
    roll = 0.3
    quaternion = (np.cos(roll / 2), np.sin(roll / 2), 0, 0)
    centres = frames(instant(attitude=np.array(quaternion)), D).wheel_centres(D)
    assert centres[0, 2] > centres[1, 2]
    assert centres[2, 2] > centres[3, 2]
    np.testing.assert_allclose(centres[0, 2] - centres[1, 2], D.track * np.sin(roll))


def test_a_raised_arm_raises_the_bucket():
    low, high = (frames(instant(lift_arm_angle=a), D).bucket.origin[2] for a in (-0.6, 0.6))
    np.testing.assert_allclose(high - low, 2 * D.arm_length * np.sin(0.6))


def test_a_rotation_matrix_is_orthogonal_and_right_handed():
    q = np.array((0.5, -0.1, 0.7, 0.5))
    r = from_quaternion(q / np.linalg.norm(q))
    np.testing.assert_allclose(r @ r.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(r), 1.0)


def test_a_wheel_without_load_is_red_and_has_no_arrow():
    standing = machine_shapes(instant(), D)
    lifted = machine_shapes(instant(normal_force=np.array((0.0, 50e3, 30e3, 30e3))), D)
    assert not any(shape.colour == LIFTED for shape in standing)
    assert sum(shape.colour == LIFTED for shape in lifted) == 1
    assert len(standing) - len(lifted) == 1


def test_the_painter_projects_the_point_looked_at_to_the_middle():
    scene = scene_of(instant(), D)
    pixel, depth = painter.project(np.array([scene.look_at]), scene)
    np.testing.assert_allclose(pixel[0], (scene.width / 2, scene.height / 2), atol=1e-9)
    np.testing.assert_allclose(depth, scene.distance)


def test_faces_look_outwards():
    """The normal of every face points away from the solid's centre."""
    for shape in machine_shapes(instant(), D):
        for polygon in painter.faces(shape):
            normal = np.cross(polygon[1] - polygon[0], polygon[2] - polygon[1])
            assert normal @ (polygon.mean(axis=0) - shape.centre) > 0


def colours(png: bytes) -> int:
    picture = matplotlib.image.imread(io.BytesIO(png))
    return len(np.unique((picture[..., :3] * 255).astype(np.uint8).reshape(-1, 3), axis=0))


def test_the_painter_draws():
    assert colours(painter.draw(scene_of(instant(), dimensions_of("l60")))) > 50


def test_the_engine_draws_the_same_machine():
    """Where there is off-screen OpenGL: both pictures have the machine at the same place."""
    scene = scene_of(instant(), dimensions_of("l60"))
    pixels = engine.draw(scene)
    if pixels is None:
        pytest.skip("no off-screen OpenGL here (EGL or OSMesa): apt install libegl1 libosmesa6")
    yellow = (pixels[..., 0] > 150) & (pixels[..., 2] < 80)
    painted = matplotlib.image.imread(io.BytesIO(painter.draw(scene)))[..., :3] * 255
    also = (painted[..., 0] > 120) & (painted[..., 2] < 80) & (painted[..., 1] > 60)
    ours, theirs = np.argwhere(yellow).mean(axis=0), np.argwhere(also).mean(axis=0)
    np.testing.assert_allclose(ours, theirs, atol=25)  # pixels of 960 x 540; shading hides some faces


def test_an_unknown_machine_is_drawn_with_typical_dimensions():
    assert dimensions_of("no such machine") == Dimensions()
