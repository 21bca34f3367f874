"""The rasteriser against rays: each pixel shows what the ray through it meets first."""

import numpy as np
import pytest

from report.render.raster import SHADOW, SUN, draw
from report.render.scene import FIELD_OF_VIEW_DEG, Scene, project
from report.render.solids import Mesh, Pose

RED, GREEN, BLUE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
WORLD = Pose(np.zeros(3), np.eye(3))
ELSEWHERE = Mesh(
    np.array([[(-99.0, 500, 5), (-99, 501, 5), (-99, 500, 6)]]), RED
)  # behind the eye, far to the left


def ahead(*meshes, **changes):
    """Looks along +x: right on the picture is -y. Without perspective 100 pixels are 10 m."""
    setting = {"look_at": np.array((0.0, 0, 5)), "elevation_deg": 0.0, "width": 120, "height": 100}
    return Scene(meshes=meshes or (ELSEWHERE,), **{**setting, "parallel": 10.0, **changes})


def sheet(x, centre_y, centre_z, half, colour):
    """A square that faces the camera."""
    y, z = centre_y + half * np.array((-1, 1, 1, -1)), centre_z + half * np.array((-1, -1, 1, 1))
    corners = np.column_stack((np.full(4, x), y, z)).astype(float)
    return Mesh(np.array((corners[[0, 1, 2]], corners[[0, 2, 3]])), colour)


def shown(picture, colour):
    """Pixels of one pure hue."""
    channel = int(np.argmax(colour))
    others = [i for i in range(3) if i != channel]
    return (picture[..., channel] > 0) & (picture[..., others] == 0).all(axis=-1)


def test_the_point_looked_at_is_in_the_middle():
    for azimuth, elevation in ((0, 0), (70, -8), (-130, -45), (20, -90)):
        scene = ahead(parallel=None, azimuth_deg=azimuth, elevation_deg=elevation)
        seen = project(scene.look_at, scene)
        np.testing.assert_allclose(seen, (60, 50, 1 / scene.distance), atol=1e-9)


def test_a_point_lands_where_similar_triangles_put_it():
    """2 m to the right, 1 m up and 4 m behind the point looked at, from a distance of 11 m."""
    scene = ahead(parallel=None)
    scale = 50 / np.tan(np.radians(FIELD_OF_VIEW_DEG / 2)) / (11 + 4)
    np.testing.assert_allclose(project(np.array((4.0, -2, 6)), scene)[:2], (60 + 2 * scale, 50 - scale))


def test_without_perspective_distance_does_not_matter():
    scene = ahead()
    near, far = project(np.array(((-3.0, -2, 6), (4.0, -2, 6))), scene)
    np.testing.assert_allclose(near[:2], (80, 40))
    np.testing.assert_allclose(far[:2], near[:2])
    assert near[2] > far[2]


def test_from_above_ahead_is_up_and_left_is_left():
    scene = ahead(look_at=np.zeros(3), elevation_deg=-90.0)
    np.testing.assert_allclose(project(np.array((1.0, 2, 0.3)), scene)[:2], (40, 40), atol=1e-9)


def test_a_square_covers_its_pixels_and_no_other():
    picture = draw(ahead(sheet(0, 2, 6, 1, RED)))
    expected = np.zeros((100, 120), bool)
    expected[30:50, 30:50] = True  # 2 m x 2 m about y = 2, z = 6
    np.testing.assert_array_equal(shown(picture, RED), expected)
    np.testing.assert_array_equal(picture[~expected], draw(ahead())[~expected])


@pytest.mark.parametrize("nearest", [0, 1, 2])
@pytest.mark.parametrize("parallel", [None, 10.0])
def test_the_nearer_surface_wins_whichever_is_drawn_first(nearest, parallel):
    sheets = [sheet(0 if i != nearest else -2, 0, 5, 1, c) for i, c in enumerate((RED, GREEN, BLUE))]
    for order in ((0, 1, 2), (2, 1, 0), (1, 2, 0)):
        picture = draw(ahead(*(sheets[i] for i in order), parallel=parallel))
        assert shown(picture, (RED, GREEN, BLUE)[nearest])[45:55, 55:65].all()


def rays(scene, eye, right, up, forward):
    """Directions through the four samples of each pixel, (rows, columns, 4, 3)."""
    scale = np.tan(np.radians(FIELD_OF_VIEW_DEG / 2)) / (scene.height / 2)
    offsets = ((0.25, 0.25), (0.25, 0.75), (0.75, 0.25), (0.75, 0.75))
    rows, columns = np.mgrid[: scene.height, : scene.width]
    found = [
        forward
        + scale * (scene.height / 2 - (rows + i))[..., None] * up
        + scale * (columns + j - scene.width / 2)[..., None] * right
        for i, j in offsets
    ]
    return np.stack(found, axis=2)


def depths(triangle, eye, direction):
    """Where each ray meets the triangle, in units of its direction; infinite where it does not."""
    a, b, c = triangle
    normal = np.cross(b - a, c - a)
    depth = ((a - eye) @ normal) / (direction @ normal)
    hit = eye + depth[..., None] * direction
    inside = np.all([np.cross(q - p, hit - p) @ normal > 0 for p, q in ((a, b), (b, c), (c, a))], axis=0)
    return np.where(inside & (depth > 0), depth, np.inf)


@pytest.mark.parametrize("seed", range(6))
def test_triangles_that_pierce_one_another_are_seen_as_by_rays(seed):
    """Three random triangles, some through one another and through the ground, in perspective."""
    random = np.random.default_rng(seed)
    triangles = random.uniform((-2, -2, -0.5), (2, 2, 3), (3, 3, 3))
    meshes = tuple(
        Mesh(t[None], colour, shadow=False) for t, colour in zip(triangles, (RED, GREEN, BLUE), strict=True)
    )
    scene = Scene(
        meshes=(*meshes, ELSEWHERE), look_at=np.array((0.0, 0, 1)), azimuth_deg=30, width=96, height=64
    )
    azimuth, elevation = np.radians((30, -8))
    forward = np.array(
        (np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation))
    )
    right = np.array((np.sin(azimuth), -np.cos(azimuth), 0))
    eye = scene.look_at - scene.distance * forward
    direction = rays(scene, eye, right, np.cross(right, forward), forward)
    downward = np.where(direction[..., 2] < 0, direction[..., 2], -np.inf)
    found = [-eye[2] / downward, *(depths(t, eye, direction) for t in triangles)]
    found[0][found[0] <= 0] = np.inf
    first = np.where(np.isfinite(np.min(found, axis=0)), np.argmin(found, axis=0), 0)
    picture, bare = (
        draw(scene),
        draw(Scene(meshes=(ELSEWHERE,), look_at=scene.look_at, azimuth_deg=30, width=96, height=64)),
    )
    whole = (first == first[..., :1]).all(axis=-1)  # edges mix
    ground = whole & (first[..., 0] == 0)
    np.testing.assert_array_equal(picture[ground], bare[ground])
    for number, colour in enumerate((RED, GREEN, BLUE), start=1):
        mine = whole & (first[..., 0] == number)
        assert shown(picture, colour)[mine].all()
        assert not (shown(picture, colour) & ground).any()
    assert {1, 2, 3} & set(np.unique(first[whole]).tolist())


def test_what_lies_behind_the_eye_is_not_drawn():
    np.testing.assert_array_equal(
        draw(ahead(ELSEWHERE, parallel=None)), draw(ahead(sheet(-50, 0, 5, 3, RED), parallel=None))
    )


def test_a_face_is_as_bright_from_either_winding_and_brighter_in_the_sun():
    one = sheet(0, 0, 5, 1, RED)
    other = Mesh(one.corners[:, ::-1], RED)
    np.testing.assert_array_equal(draw(ahead(one)), draw(ahead(other)))
    lit = draw(ahead(one, azimuth_deg=180.0))[50, 60, 0]  # seen from the side where the sun stands
    assert SUN[0] > 0
    assert lit > draw(ahead(one))[50, 60, 0]


def test_the_shadow_lies_where_the_sun_casts_it():
    """Of a plate 2 m up; the ground right below it stays bright."""
    plate = WORLD.box((0, 0, 2), (0.3, 0.3, 0.01), RED)
    view = {"look_at": np.zeros(3), "elevation_deg": -20.0, "parallel": None, "width": 300, "height": 200}
    picture, bare = draw(ahead(plate, **view)), draw(ahead(**view))
    place = np.array((0, 0, 2)) - 2 * SUN / SUN[2] + (0.05, 0.05, 0)  # off the grid's lines
    x, y, _ = project(place, ahead(**view))
    np.testing.assert_allclose(picture[int(y), int(x)], bare[int(y), int(x)] * SHADOW, atol=1.5)
    x, y, _ = project(np.array((0.05, 0.05, 0)), ahead(**view))
    np.testing.assert_array_equal(picture[int(y), int(x)], bare[int(y), int(x)])


def test_a_solid_that_casts_no_shadow_leaves_the_ground_bright():
    plate = WORLD.box((0, 0, 2), (0.3, 0.3, 0.01), RED)
    view = {"look_at": np.zeros(3), "elevation_deg": -20.0, "parallel": None}
    picture = draw(ahead(Mesh(plate.corners, RED, shadow=False), ELSEWHERE, **view))
    ground = ~shown(picture, RED)
    edge = (picture[..., 0] > picture[..., 2]) & ground  # pixels that mix plate and ground
    np.testing.assert_array_equal(picture[ground & ~edge], draw(ahead(**view))[ground & ~edge])


def test_the_grid_is_one_metre_wide():
    """From above at 20 pixels a metre, a row between two lines crosses the lines of whole y only."""
    scene = ahead(look_at=np.array((0.5, 0.5, 0)), elevation_deg=-90.0, parallel=10.0, height=200, width=200)
    row = draw(scene)[100].astype(int).sum(axis=1)
    dark = np.flatnonzero(row < row.max())
    centres = [group.mean() for group in np.split(dark, np.flatnonzero(np.diff(dark) > 2) + 1)]
    np.testing.assert_allclose(np.diff(centres), 20)
    assert len(centres) == 10


def test_sky_is_above_the_horizon_and_ground_below():
    picture = draw(ahead(parallel=None)).astype(int)
    assert (picture[:45, :, 2] >= picture[:45, :, 0]).all()
    below = picture[60:].reshape(-1, 3)
    assert (np.ptp(below, axis=1) <= 16).all()
