"""A scene: solids, and the camera that looks at them."""

from dataclasses import dataclass

import numpy as np

from report.render.solids import Array, Mesh

FIELD_OF_VIEW_DEG = 30.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """Solids and the camera."""

    meshes: tuple[Mesh, ...]
    look_at: Array  # point in the world in the middle of the picture [m]
    distance: float = 11.0  # of the eye from that point [m]
    azimuth_deg: float = 0.0  # direction of view, from +x to the left
    elevation_deg: float = -8.0  # below 0 the camera looks down
    width: int = 960  # [pixels]
    height: int = 540
    parallel: float | None = None  # height of a drawing without perspective [m]; None: with perspective


def view_of(scene: Scene) -> tuple[Array, Array]:
    """Position of the eye, and the rows right, up and forward of the view."""
    azimuth, elevation = np.radians((scene.azimuth_deg, scene.elevation_deg))
    forward = np.array(
        (np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation))
    )
    right = np.array((np.sin(azimuth), -np.cos(azimuth), 0.0))
    return scene.look_at - scene.distance * forward, np.array((right, np.cross(right, forward), forward))


def project(points: Array, scene: Scene) -> Array:
    """Pixels from the top left and nearness of world points (..., 3), in the last axis.

    Nearness grows towards the eye and is linear across the picture, as depth buffers need it;
    it is not positive for points behind a perspective camera.
    """
    eye, view = view_of(scene)
    seen = (points - eye) @ view.T
    if scene.parallel is None:
        depth = np.where(np.abs(seen[..., 2]) > 1e-6, seen[..., 2], 1e-6)
        scale = scene.height / 2 / np.tan(np.radians(FIELD_OF_VIEW_DEG) / 2) / depth
        near = 1.0 / depth
    else:
        scale = np.full(seen.shape[:-1], scene.height / scene.parallel)
        near = 1e3 - seen[..., 2]
    x = scene.width / 2 + scale * seen[..., 0]
    y = scene.height / 2 - scale * seen[..., 1]
    return np.stack((x, y, near), axis=-1)
