"""The camera views that a picture or a video can have."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Any

from report.render.loader import Dimensions
from report.render.pictures import VIEW_METRES, VIEWS, flat_scene, scene_of
from report.render.scene import Scene


class View(StrEnum):
    """The side from which the machine is seen."""

    FRONT_LEFT = "front-left"
    FRONT_RIGHT = "front-right"
    BEHIND = "behind"
    LEFT = "left"
    ABOVE = "above"


ROOM = 1.15  # the view is larger than the machine by this factor: room for the texts on the frame
_FLAT = dict(zip((View.BEHIND, View.LEFT, View.ABOVE), zip(VIEWS, VIEW_METRES, strict=True), strict=True))


def scene_in(
    view: View, instant: Mapping[str, Any], dimensions: Dimensions, heading: float, size: tuple[int, int]
) -> Scene:
    """One instant in a view.

    heading: of the machine when the camera was set up [rad]; from behind and from the left the camera
    turns with the machine, otherwise it follows without turning. size: width and height [pixels].
    """
    # drawings without perspective: lengths can be compared
    if view in _FLAT:
        turning = view is not View.ABOVE
        looking, metres = _FLAT[view]
        return flat_scene(
            instant,
            dimensions,
            looking,
            ROOM * metres,
            heading=float(instant["yaw"]) if turning else heading,
            size=size,
        )
    side = 1 if view is View.FRONT_LEFT else -1
    return scene_of(instant, dimensions, side=side, heading=heading, size=size)
