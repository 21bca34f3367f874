"""Draws a scene without a graphics library, so that no display is needed: a depth buffer, filled triangle by triangle.

Flat shading by one sun and the eye, a shadow on the ground, a metre grid. Four samples per pixel.
"""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bus.cache_folder import digest_of
from bus.machine_code import code_folder, compiler
from report.render.scene import FIELD_OF_VIEW_DEG, Scene, project, view_of
from report.render.solids import Array

_FILE = Path(__file__).resolve()
_compiled = compiler(code_folder(_FILE.parent, "raster", digest_of([_FILE])))

Pixels = NDArray[np.uint8]

SAMPLES = 2  # per pixel and direction
SUN = np.array((0.35, 0.30, 0.89)) / math.sqrt(0.35**2 + 0.30**2 + 0.89**2)
GROUND = np.array((0.68, 0.69, 0.68))
LINE = np.array((0.57, 0.58, 0.58))
ZENITH = np.array((0.70, 0.80, 0.89))
HORIZON = np.array((0.93, 0.95, 0.97))
PAPER = np.array((0.96, 0.97, 0.98))
SHADOW = 0.62
FOG_M = 30.0  # the grid fades into the horizon at this distance
LINE_M = 0.022  # half width of a grid line


def draw(scene: Scene) -> Pixels:
    """The picture as (height, width, 3)."""
    colour, near = _background(scene)
    corners = np.concatenate([mesh.corners for mesh in scene.meshes])
    counts = [len(mesh.corners) for mesh in scene.meshes]
    paint = np.repeat(np.array([mesh.colour for mesh in scene.meshes]), counts, axis=0)
    # a camera that looks level sees the ground as a line: no shadow on it
    if scene.elevation_deg < 0:
        solid = np.concatenate([mesh.corners for mesh in scene.meshes if mesh.shadow])
        _darken(_fine(_on_ground(solid), scene), SHADOW, colour, near)
    shade = _shade(corners, view_of(scene)[1][2])
    _fill(_fine(corners, scene), paint * shade[:, None], colour, near)
    # the mean of SAMPLES x SAMPLES samples smooths the edges
    coarse = colour.reshape(scene.height, SAMPLES, scene.width, SAMPLES, 3).mean(axis=(1, 3))
    return np.rint(255 * np.clip(coarse, 0, 1)).astype(np.uint8)


def _fine(corners: Array, scene: Scene) -> Array:
    """Corners in samples instead of pixels."""
    seen = project(corners, scene)
    seen[..., :2] *= SAMPLES
    return seen


def _on_ground(corners: Array) -> Array:
    """Where the sun casts each corner on the plane z = 0."""
    return np.asarray(corners - corners[..., 2:3] * (SUN / SUN[2]))


def _shade(corners: Array, forward: Array) -> Array:
    """Brightness of each triangle, the same from both sides: the solids are not closed everywhere."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    normal /= np.where(length > 0, length, 1.0)[:, None]
    towards = -np.sign(normal @ forward)
    sun = np.maximum(0.0, (normal @ SUN) * towards)
    return np.asarray(0.50 + 0.42 * sun + 0.16 * np.abs(normal @ forward))


def _background(scene: Scene) -> tuple[Array, Array]:
    """Sky and ground with its grid, and the nearness of the ground (below everything where there is sky)."""
    eye, view = view_of(scene)
    rows = scene.height / 2 - (np.arange(scene.height * SAMPLES) + 0.5) / SAMPLES
    columns = (np.arange(scene.width * SAMPLES) + 0.5) / SAMPLES - scene.width / 2
    if scene.parallel is not None:
        scale = scene.parallel / scene.height
        return _paper(eye, view, rows * scale, columns * scale)
    scale = math.tan(math.radians(FIELD_OF_VIEW_DEG) / 2) / (scene.height / 2)
    return _landscape(eye, view, rows * scale, columns * scale)


@_compiled
def _on_line(x: float, y: float) -> bool:
    return min(abs(x - round(x)), abs(y - round(y))) < LINE_M


@_compiled
def _landscape(eye: Array, view: Array, up: Array, right: Array) -> tuple[Array, Array]:
    """Sky, ground and grid in perspective, and their nearness. up, right: slopes of the rays against the view direction."""
    colour = np.empty((up.size, right.size, 3))
    near = np.zeros((up.size, right.size))
    for i in range(up.size):
        for j in range(right.size):
            ray = view[2] + up[i] * view[1] + right[j] * view[0]
            if ray[2] < -1e-9:
                depth = -eye[2] / ray[2]
                near[i, j] = 1.0 / depth
                hit = eye + depth * ray
                base = LINE if _on_line(hit[0], hit[1]) else GROUND
                fog = min(1.0, depth / FOG_M) ** 2
                colour[i, j] = base * (1 - fog) + HORIZON * fog
            else:
                height = min(1.0, 3.0 * ray[2])
                colour[i, j] = ZENITH * height + HORIZON * (1 - height)
    return colour, near


@_compiled
def _paper(eye: Array, view: Array, up: Array, right: Array) -> tuple[Array, Array]:
    """Background of a drawing: the grid from above, or the ground as a band from the side."""
    colour = np.empty((up.size, right.size, 3))
    near = np.zeros((up.size, right.size))
    from_above = abs(view[2, 2]) > 0.5
    for i in range(up.size):
        for j in range(right.size):
            at = eye + up[i] * view[1] + right[j] * view[0]
            if from_above:
                colour[i, j] = LINE + 0.25 if _on_line(at[0], at[1]) else PAPER
            elif at[2] < 0:
                colour[i, j] = GROUND
                near[i, j] = np.inf  # a cut through the ground: nothing is seen below it
            else:
                colour[i, j] = PAPER
    return colour, near


@_compiled
def _bounds(corners: Array, shape: tuple[int, int]) -> tuple[int, int, int, int, float]:
    """Rows and columns that a triangle can cover, and twice its signed area; empty behind the eye."""
    # behind the eye the projection is not defined; the camera stands outside of the machine, so nothing is lost
    if min(corners[0, 2], corners[1, 2], corners[2, 2]) <= 0:
        return 0, 0, 0, 0, 0.0
    x, y = corners[:, 0], corners[:, 1]
    area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
    top, bottom = max(0, math.floor(y.min())), min(shape[0], math.ceil(y.max()) + 1)
    left, right = max(0, math.floor(x.min())), min(shape[1], math.ceil(x.max()) + 1)
    return top, bottom, left, right, area


@_compiled
def _weights(corners: Array, area: float, x: float, y: float) -> tuple[float, float, float]:
    """Barycentric weights of a sample; one is negative when it lies outside."""
    a = ((corners[1, 0] - x) * (corners[2, 1] - y) - (corners[2, 0] - x) * (corners[1, 1] - y)) / area
    b = ((corners[2, 0] - x) * (corners[0, 1] - y) - (corners[0, 0] - x) * (corners[2, 1] - y)) / area
    return a, b, 1.0 - a - b


@_compiled
def _fill_one(corners: Array, paint: Array, colour: Array, near: Array) -> None:
    top, bottom, left, right, area = _bounds(corners, near.shape)
    if area == 0.0:
        return
    for i in range(top, bottom):
        for j in range(left, right):
            a, b, c = _weights(corners, area, j + 0.5, i + 0.5)
            if a >= 0 and b >= 0 and c >= 0:
                nearness = a * corners[0, 2] + b * corners[1, 2] + c * corners[2, 2]
                if nearness > near[i, j]:
                    near[i, j] = nearness
                    colour[i, j] = paint


@_compiled
def _fill(corners: Array, paint: Array, colour: Array, near: Array) -> None:
    """Paint every triangle (x, y, nearness of its corners) where it is nearest."""
    for n in range(corners.shape[0]):
        _fill_one(corners[n], paint[n], colour, near)


@_compiled
def _shadow_one(corners: Array, factor: float, colour: Array, near: Array, done: NDArray[np.bool_]) -> None:
    top, bottom, left, right, area = _bounds(corners, near.shape)
    if area == 0.0:
        return
    for i in range(top, bottom):
        for j in range(left, right):
            a, b, c = _weights(corners, area, j + 0.5, i + 0.5)
            if a >= 0 and b >= 0 and c >= 0 and not done[i, j] and near[i, j] > 0:
                done[i, j] = True
                colour[i, j] *= factor


@_compiled
def _darken(corners: Array, factor: float, colour: Array, near: Array) -> None:
    """Darken the ground below triangles that lie on it, each sample once."""
    done = np.zeros(near.shape, np.bool_)
    for n in range(corners.shape[0]):
        _shadow_one(corners[n], factor, colour, near, done)
