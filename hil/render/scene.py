"""A scene: shapes and the camera that looks at them."""

from dataclasses import dataclass

from hil.render.shapes import Array, Shape


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """look_at: point in the world [m]; azimuth: where the camera looks, from +x to the left [deg]; elevation below 0 looks down."""

    shapes: tuple[Shape, ...]
    look_at: Array
    distance: float = 12.0
    azimuth_deg: float = 0.0
    elevation_deg: float = -17.0
    width: int = 960
    height: int = 540


@dataclass(frozen=True, slots=True)
class Picture:
    """A drawn picture with the sentence below it."""

    png: bytes
    caption: str
