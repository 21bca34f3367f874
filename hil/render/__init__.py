"""Pictures of the machine at chosen moments of a run.

MuJoCo draws them off-screen (EGL or OSMesa); where it or the graphics libraries are missing,
matplotlib draws the same shapes, and the caption says so.
"""

import io
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.image
import numpy as np

from hil.render import engine, painter
from hil.render.scene import Picture, Scene
from hil.render.shapes import Dimensions, machine_shapes
from hil.rundir import RunDirectory
from hil.verdict import WHEELS, RunVerdict
from plant.machine import load_machine

AFTER_LIFT_OFF_S = 0.25
"""The picture is taken this long after the wheel lost contact, so that the gap can be seen."""
NEEDED = (
    "position", "attitude", "yaw", "articulation_angle", "oscillation_angle", "lift_arm_angle",
    "tilt_angle", "normal_force", "payload_mass",
)  # fmt: skip


def dimensions_of(machine: str) -> Dimensions:
    """Dimensions for the drawing, from the machine file; a typical loader's where it cannot be read."""
    try:
        m = load_machine(machine)
    except (ValueError, OSError):
        return Dimensions()
    return Dimensions(
        joint_height=m.geometry.joint_height,
        front_axle=m.geometry.front_axle_x,
        rear_axle=m.geometry.rear_axle_x,
        track=m.geometry.track,
        wheel_height=m.geometry.wheel_centre_height,
        wheel_radius=m.tyre.radius,
        arm_x=m.lift.pivot_x,
        arm_z=m.lift.pivot_z,
        arm_length=m.lift.arm_length,
    )


def scene_of(instant: Mapping[str, Any], dimensions: Dimensions, *, lifting: int | None = None) -> Scene:
    """The machine from in front, on the side of the wheel that lifts (index) or else the left."""
    side = 1 if lifting in (None, 0, 2) else -1
    azimuth = np.degrees(float(instant["yaw"])) + 180 + side * 68
    centre = np.asarray(instant["position"], float)
    return Scene(
        shapes=tuple(machine_shapes(instant, dimensions)),
        look_at=np.array((centre[0], centre[1], 1.1)),
        azimuth_deg=float(azimuth),
    )


def render(instant: Mapping[str, Any], machine: str, *, lifting: int | None = None) -> tuple[bytes, str]:
    """The picture as PNG, and a remark on how it was drawn ('' for MuJoCo).

    instant: one row of the truth by field name.
    """
    scene = scene_of(instant, dimensions_of(machine), lifting=lifting)
    pixels = engine.draw(scene)
    if pixels is None:
        return painter.draw(scene), " (drawn without off-screen OpenGL)"
    out = io.BytesIO()
    matplotlib.image.imsave(out, pixels, format="png")
    return out.getvalue(), ""


def instant_at(run: RunDirectory, time_s: float) -> dict[str, Any]:
    """The truth's row nearest to `time_s`."""
    index = int(np.argmin(np.abs(run.truth["time_s"] - time_s)))
    return {name: run.truth[name][index] for name in NEEDED}


def moments(verdict: RunVerdict, end_s: float, lowest_s: float) -> list[tuple[float, str]]:
    """Which moments are worth a picture, and what they show.

    lowest_s: when the least loaded wheel carried least.
    """
    if verdict.lift_off_s is None or verdict.lifting_wheel is None:
        return [(lowest_s, f"At {lowest_s:.2f} s, where the least loaded wheel carries least")]
    lifted = min(verdict.lift_off_s + AFTER_LIFT_OFF_S, end_s)
    shown = [(lifted, f"At {lifted:.2f} s: the {WHEELS[verdict.lifting_wheel]} wheel has lifted")]
    if verdict.rolled_over_s is not None:
        shown.append((verdict.rolled_over_s, f"At {verdict.rolled_over_s:.2f} s: past the point of return"))
    return shown


def pictures_of(run: RunDirectory, verdict: RunVerdict | None) -> Sequence[Picture]:
    """Pictures of a run: at lift-off and beyond, or where it came closest to it."""
    if verdict is None or any(name not in run.truth for name in NEEDED):
        return []
    time, force = run.truth["time_s"], run.truth["normal_force"]
    lowest = float(time[np.argmin((force / force[0]).min(axis=1))])
    drawn = []
    for moment, caption in moments(verdict, float(time[-1]), lowest):
        png, remark = render(instant_at(run, moment), run.record.machine, lifting=verdict.lifting_wheel)
        drawn.append(Picture(png, f"{caption}. Green posts: wheel loads; red: a wheel without load.{remark}"))
    return drawn
