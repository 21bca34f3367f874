"""Draws shapes with matplotlib where there is no off-screen OpenGL: faces sorted by depth, far to near."""

import io

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from hil.render.scene import Scene
from hil.render.shapes import Array, Shape

SIDES = 24
LIGHT = np.array((0.35, 0.45, 0.82))
FIELD_OF_VIEW_DEG = 32.0


def faces(shape: Shape) -> list[Array]:
    """The solid's faces as (n, 3) polygons in the world, counter-clockwise seen from outside."""
    if shape.kind == "box":
        a, b, c = shape.size
        corners = np.array([(x, y, z) for x in (-a, a) for y in (-b, b) for z in (-c, c)])
        index = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
        local = [corners[list(i)] for i in index]
    else:
        radius, half = shape.size
        turn = np.linspace(0, 2 * np.pi, SIDES, endpoint=False)
        rim = np.column_stack((radius * np.cos(turn), radius * np.sin(turn)))
        top = np.column_stack((rim, np.full(SIDES, half)))
        bottom = np.column_stack((rim, np.full(SIDES, -half)))
        local = [top, bottom[::-1]]
        for i in range(SIDES):
            k = (i + 1) % SIDES
            local.append(np.array((bottom[i], bottom[k], top[k], top[i])))
    return [points @ shape.rotation.T + shape.centre for points in local]


def camera(scene: Scene) -> tuple[Array, Array]:
    """Position of the eye, and the rows right, up and forward of the view."""
    azimuth, elevation = np.radians((scene.azimuth_deg, scene.elevation_deg))
    forward = np.array(
        (np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation))
    )
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    return np.asarray(scene.look_at) - scene.distance * forward, np.array(
        (right, np.cross(right, forward), forward)
    )


def project(points: Array, scene: Scene) -> tuple[Array, Array]:
    """Pixels (n, 2), origin top left, and depths (n) of world points (n, 3)."""
    eye, view = camera(scene)
    seen = (points - eye) @ view.T
    focal = scene.height / 2 / np.tan(np.radians(FIELD_OF_VIEW_DEG) / 2)
    depth = np.maximum(seen[:, 2], 1e-3)
    pixel = np.column_stack(
        (scene.width / 2 + focal * seen[:, 0] / depth, scene.height / 2 - focal * seen[:, 1] / depth)
    )
    return pixel, seen[:, 2]


def draw(scene: Scene) -> bytes:
    """The picture as PNG."""
    figure = Figure(figsize=(scene.width / 100, scene.height / 100), dpi=100, facecolor="#e9edf0")
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_xlim(0, scene.width)
    axes.set_ylim(scene.height, 0)
    axes.axis("off")
    eye, _ = camera(scene)
    _draw_ground(axes, scene)
    painted = []
    for shape in scene.shapes:
        for polygon in faces(shape):
            normal = np.cross(polygon[1] - polygon[0], polygon[2] - polygon[1])
            if normal @ (eye - polygon[0]) <= 0:
                continue
            length = float(np.linalg.norm(normal))
            shade = 0.72 + 0.28 * max(0.0, float(normal @ LIGHT) / length) if length else 1.0
            pixels, depth = project(polygon, scene)
            painted.append((float(depth.mean()), pixels, tuple(min(1.0, c * shade) for c in shape.colour)))
    for _, pixels, colour in sorted(painted, key=lambda item: -item[0]):
        axes.add_patch(Polygon(pixels, closed=True, facecolor=colour, edgecolor="#00000030", linewidth=0.4))
    out = io.BytesIO()
    figure.savefig(out, format="png")
    return out.getvalue()


def _draw_ground(axes: Axes, scene: Scene) -> None:
    """A metre grid on the road around the machine."""
    centre = np.round(np.asarray(scene.look_at)[:2])
    reach = 6.0
    for i in np.arange(-reach, reach + 0.5):
        for ends in (((i, -reach), (i, reach)), ((-reach, i), (reach, i))):
            line = np.array([(*(centre + end), 0.0) for end in ends])
            pixels, _ = project(line, scene)
            axes.plot(pixels[:, 0], pixels[:, 1], color="#b9bfc4", linewidth=0.7, zorder=0)
