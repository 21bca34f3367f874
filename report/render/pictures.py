"""The pictures of a run for its report: stills at the decisive moments, three views, and the run as a film."""

import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image

from hil.rundir import RunDirectory
from hil.verdict import WHEELS, RunVerdict
from plant.sheets.changes import Changes
from plant.sheets.machine import load_machine
from report.render import raster
from report.render.loader import FIELDS, METRES_PER_NEWTON, Dimensions, frames, machine_meshes
from report.render.scene import Scene

AFTER_LIFT_OFF_S = 0.25
"""The picture of a lift-off is taken this long after the wheel lost contact, so that the gap can be seen."""
QUARTER_DEG = 64.0
"""Angle between the camera and the direction ahead of the machine [deg]."""
FILM_FRAMES, FILM_COLUMNS, FILM_SIZE = 48, 8, (400, 225)
QUALITY = 82
VIEWS = (("from behind", 0.0, 0.0), ("from the left", -90.0, 0.0), ("from above", 0.0, -90.0))
VIEW_SIZE = (420, 300)
VIEW_METRES = (4.9, 5.4, 7.4)  # height of the picture in each of the views [m]


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture for the report."""

    data: bytes
    kind: str  # media type
    size: tuple[int, int]  # width and height [pixels]
    caption: str


@dataclass(frozen=True, slots=True)
class Film:
    """Frames of a run in one picture, row by row: one data URL, of which the script shows a part."""

    sheet: bytes
    columns: int
    rows: int
    size: tuple[int, int]  # of one frame [pixels]
    times_s: tuple[float, ...]  # of each frame
    start: int  # index of the frame to begin with


@dataclass(frozen=True, slots=True)
class Pictures:
    """The pictures of a run, or the reason why there are none."""

    stills: Sequence[Picture] = ()
    views: Picture | None = None
    film: Film | None = None
    missing: str = ""


def dimensions_of(machine: str, words: Sequence[str] = ()) -> Dimensions:
    """Dimensions for the drawing, from the machine file and a run's KEY=VALUE changes; a typical loader's if it cannot be read."""
    try:
        m = load_machine(machine, Changes.of(words).machine)
    # an old run may name a machine file that has moved: a typical loader is drawn instead of nothing
    except (ValueError, OSError):
        return Dimensions()
    return Dimensions(
        joint_height=m.geometry.joint_height,
        pivot_height=m.oscillation.pivot_height,
        front_axle=m.geometry.front_axle_x,
        rear_axle=m.geometry.rear_axle_x,
        track=m.geometry.track,
        wheel_height=m.geometry.wheel_centre_height,
        wheel_radius=m.tyre.radius,
        arm_x=m.lift.pivot_x,
        arm_z=m.lift.pivot_z,
        arm_length=m.lift.arm_length,
    )


def scene_of(
    instant: Mapping[str, Any],
    dimensions: Dimensions,
    *,
    side: int = 1,
    heading: float | None = None,
    size: tuple[int, int] = (960, 540),
) -> Scene:
    """The machine from ahead and one side (1: its left).

    heading [rad] is that of the machine for which the camera was set up; None takes this instant's.
    """
    heading = float(instant["yaw"]) if heading is None else heading
    centre = np.asarray(instant["position"], float)
    return Scene(
        meshes=tuple(machine_meshes(instant, dimensions)),
        look_at=np.array((centre[0], centre[1], 1.15)),
        azimuth_deg=np.degrees(heading) + 180 + side * QUARTER_DEG,
        width=size[0],
        height=size[1],
    )


def render(
    instant: Mapping[str, Any], machine: str, *, side: int = 1, size: tuple[int, int] = (960, 540)
) -> bytes:
    """The machine at one instant (a row of the truth by field name) as PNG."""
    return png(raster.draw(scene_of(instant, dimensions_of(machine), side=side, size=size)))


def png(pixels: raster.Pixels) -> bytes:
    """Pixels (height, width, 3) as a PNG file."""
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, "PNG", optimize=True)
    return out.getvalue()


def flat_scene(
    instant: Mapping[str, Any],
    dimensions: Dimensions,
    view: tuple[str, float, float],
    metres: float,
    *,
    heading: float,
    size: tuple[int, int] = VIEW_SIZE,
) -> Scene:
    """The machine without perspective in one of VIEWS, `metres` from top to bottom; heading [rad] as for scene_of."""
    _, azimuth, elevation = view
    centre = np.asarray(instant["position"], float)
    height = metres / 2 - 0.35 if elevation == 0 else 0.0
    return Scene(
        meshes=tuple(machine_meshes(instant, dimensions)),
        look_at=np.array((centre[0], centre[1], height)),
        azimuth_deg=np.degrees(heading) + azimuth,
        elevation_deg=elevation,
        width=size[0],
        height=size[1],
        parallel=metres,
    )


def views(instant: Mapping[str, Any], dimensions: Dimensions) -> raster.Pixels:
    """The machine from behind, from the left and from above, side by side, to scale."""
    heading = float(instant["yaw"])
    drawn = [
        raster.draw(flat_scene(instant, dimensions, view, metres, heading=heading))
        for view, metres in zip(VIEWS, VIEW_METRES, strict=True)
    ]
    return np.concatenate(drawn, axis=1)


def instant_at(run: RunDirectory, time_s: float) -> dict[str, Any]:
    """The truth's row nearest to `time_s`."""
    index = int(np.argmin(np.abs(run.truth["time_s"] - time_s)))
    return {name: run.truth[name][index] for name in FIELDS}


def clearance(instant: Mapping[str, Any], dimensions: Dimensions) -> list[float]:
    """Gap between each tyre, unloaded and without its width, and the ground [m]; negative: pressed in."""
    gaps = []
    for pose in frames(instant, dimensions).wheels:
        axle = pose.rotation[:, 1]
        gaps.append(float(pose.origin[2] - dimensions.wheel_radius * np.hypot(axle[0], axle[1])))
    return gaps


def moments(verdict: RunVerdict, end_s: float, lowest_s: float) -> list[tuple[float, str]]:
    """Times of the stills [s], each with a description.

    lowest_s: when the least loaded wheel carried least.
    """
    if verdict.lift_off_s is None or verdict.lifting_wheel is None:
        return [(lowest_s, "the least loaded wheel carries least"), (end_s, "the end of the run")]
    lifted = min(verdict.lift_off_s + AFTER_LIFT_OFF_S, end_s)
    shown = [
        (
            lifted,
            f"{lifted - verdict.lift_off_s:.2f} s after the {WHEELS[verdict.lifting_wheel]} wheel lifted",
        )
    ]
    if verdict.rolled_over_s is not None:
        shown.append((verdict.rolled_over_s, "45° of roll, past the point of return"))
    return shown


def pictures_of(run: RunDirectory, verdict: RunVerdict | None) -> Pictures:
    """Pictures of a run: at lift-off and beyond, or where it came closest to it."""
    if missing := [name for name in (*FIELDS, "time_s") if name not in run.truth]:
        return Pictures(missing=f"the truth has no {', '.join(missing)}")
    if verdict is None:
        return Pictures(missing="the run could not be judged, so no moment stands out")
    time, force = run.truth["time_s"], run.truth["normal_force"]
    if not all(np.isfinite(run.truth[name]).all() for name in FIELDS):
        return Pictures(missing="the truth has values that are not finite")
    dimensions = dimensions_of(run.record.machine, run.record.changes)
    # without a lift-off the wheel that came closest to it is shown
    sample, wheel = np.unravel_index(np.argmin(force / force[0]), force.shape)
    lifting = verdict.lifting_wheel if verdict.lifting_wheel is not None else int(wheel)
    # the camera stands on the side of the lifting wheel
    side = 1 if lifting in (0, 2) else -1
    shown = moments(verdict, float(time[-1]), float(time[sample]))
    stills = [
        Picture(
            png(raster.draw(scene_of(instant_at(run, at), dimensions, side=side))),
            "image/png",
            (960, 540),
            _caption(at, what, instant_at(run, at), dimensions),
        )
        for at, what in shown
    ]
    first = instant_at(run, shown[0][0])
    return Pictures(
        stills=stills,
        views=Picture(
            png(views(first, dimensions)),
            "image/png",
            (3 * VIEW_SIZE[0], VIEW_SIZE[1]),
            f"At {shown[0][0]:.2f} s from behind, from the left and from above, each to its own scale.",
        ),
        film=_film(run, dimensions, side, float(first["yaw"]), shown[0][0]),
    )


def _caption(at_s: float, what: str, instant: Mapping[str, Any], dimensions: Dimensions) -> str:
    force = np.asarray(instant["normal_force"], float)
    loads = ", ".join(f"{wheel} {f * 1e-3:.1f}" for wheel, f in zip(WHEELS, force, strict=True))
    gaps = [
        f"{wheel} {100 * gap:.0f} cm"
        for wheel, gap, f in zip(WHEELS, clearance(instant, dimensions), force, strict=True)
        if not f > 0
    ]
    above = f" Above the ground: {', '.join(gaps)}." if gaps else ""
    return f"At {at_s:.2f} s: {what}. Wheel loads [kN]: {loads}.{above}"


def arrow_key() -> str:
    """The legend of arrows and colours."""
    return (
        f"Blue arrows are wheel loads, 1 m for {1e-3 / METRES_PER_NEWTON:.0f} kN; "
        "an orange-red wheel carries none. Ground grid: 1 m."
    )


def _film(run: RunDirectory, dimensions: Dimensions, side: int, heading: float, start_s: float) -> Film:
    """The whole run; the camera follows without turning, so that the machine's own turning is visible."""
    time = run.truth["time_s"]
    times = np.linspace(float(time[0]), float(time[-1]), FILM_FRAMES)
    drawn = [
        raster.draw(scene_of(instant_at(run, at), dimensions, side=side, heading=heading, size=FILM_SIZE))
        for at in times
    ]
    sheet = np.concatenate([np.concatenate(row, axis=1) for row in _rows(drawn, FILM_COLUMNS)])
    out = io.BytesIO()
    # WEBP with loss: smaller than PNG, and every browser reads it
    Image.fromarray(sheet).save(out, "WEBP", quality=QUALITY)
    return Film(
        sheet=out.getvalue(),
        columns=FILM_COLUMNS,
        rows=len(drawn) // FILM_COLUMNS,
        size=FILM_SIZE,
        times_s=tuple(float(t) for t in times),
        start=int(np.argmin(np.abs(times - start_s))),
    )


def _rows(items: Sequence[raster.Pixels], length: int) -> Iterable[Sequence[raster.Pixels]]:
    return (items[i : i + length] for i in range(0, len(items), length))
