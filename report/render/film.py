"""Renders a run into a PNG, a GIF or an MP4 file, for `loaderhil render`.

MP4 is H.264 by PyAV, whose wheel brings its encoder; everything else needs no more than Pillow. Nothing is drawn by a
graphics driver: no display is needed.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from bus.user_error import UserError
from hil.judgement import judge_run
from hil.rundir import RunDirectory, writing
from report.render.board import WarningLine, written
from report.render.camera import View, scene_in
from report.render.loader import FIELDS
from report.render.pictures import dimensions_of, instant_at, moments
from report.render.raster import Pixels, draw

NEEDED = (*FIELDS, "time_s", "speed")
LEAST_GIF_MS = 20  # a shorter time per frame is shown slower by most programs
QUALITY = "20"  # constant rate factor of H.264: 18 looks lossless, 28 does not


class RenderError(UserError, ValueError):
    """A run cannot be drawn, or not into that file; the message says why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """The part of a run that is drawn, and how."""

    start_s: float  # on the run's clock [s]
    end_s: float
    fps: float  # pictures per second
    view: View
    size: tuple[int, int]  # width and height [pixels]

    @property
    def times_s(self) -> list[float]:
        """When the pictures are taken."""
        count = max(int((self.end_s - self.start_s) * self.fps + 1e-6), 0) + 1
        return [self.start_s + i / self.fps for i in range(count)]


def checked(run: RunDirectory) -> RunDirectory:
    """The run, if its truth has the columns that a picture needs. RenderError otherwise."""
    missing = [name for name in NEEDED if name not in run.truth]
    if missing or not run.truth["time_s"].size:
        cause = f"no {', '.join(missing)}" if missing else "no sample"
        raise RenderError(
            f"{run.path}: its truth has {cause}: {'; '.join(run.problems) or 'nothing to draw'}"
        )
    wrong = [name for name in NEEDED if not np.isfinite(run.truth[name]).all()]
    if wrong:
        raise RenderError(f"{run.path}: {', '.join(wrong)} of its truth is not finite everywhere")
    return run


def decisive_moment(run: RunDirectory) -> float:
    """The time that a single picture should show [s]: just after a lift-off, else at the smallest wheel load."""
    time, force = run.truth["time_s"], run.truth["normal_force"]
    least = float(time[np.argmin((force / force[0]).min(axis=1))])
    return moments(judge_run(run), float(time[-1]), least)[0][0]


def frames(run: RunDirectory, shot: Shot) -> Iterator[Pixels]:
    """The pictures of a shot, (height, width, 3) each."""
    dimensions = dimensions_of(run.record.machine, run.record.changes)
    warnings = WarningLine.of(run)
    # the camera is set up once: a picture in which it turned would hide the motion
    heading = float(instant_at(run, shot.start_s)["yaw"])
    time = run.truth["time_s"]
    for at in shot.times_s:
        instant = instant_at(run, at)
        pixels = draw(scene_in(shot.view, instant, dimensions, heading, shot.size))
        speed = float(np.interp(at, time, run.truth["speed"]))
        yield written(pixels, at, instant, speed, warnings.at(at))


def write(file: Path, pictures: Iterator[Pixels], fps: float) -> None:
    """Write all pictures into `file`, complete or not at all; its suffix chooses the format."""
    # the suffix stays last: Pillow and PyAV choose the format by it
    part = file.with_name(f".{file.stem}.part{file.suffix}")
    with writing(file):
        file.parent.mkdir(parents=True, exist_ok=True)
        try:
            _WRITERS[file.suffix](part, pictures, fps)
            part.replace(file)
        finally:
            part.unlink(missing_ok=True)


def suffix_checked(file: Path) -> None:
    """Refuse a suffix that cannot be written, before anything is drawn: drawing takes minutes."""
    if file.suffix not in _WRITERS:
        raise RenderError(f"{file}: is none of {', '.join(_WRITERS)}")
    if file.suffix == ".mp4":
        _av()


def _av() -> Any:
    try:
        import av
    except ImportError:
        raise RenderError(
            "MP4 needs PyAV: pip install 'loaderhil[render]'; or write a .gif, which needs nothing more"
        ) from None
    return av


def _write_mp4(file: Path, pictures: Iterator[Pixels], fps: float) -> None:
    with _av().open(str(file), "w", format="mp4") as container:
        stream = None
        for pixels in pictures:
            if stream is None:
                # made with the first picture, whose size it needs
                stream = container.add_stream("libx264", rate=Fraction(fps).limit_denominator(1000))
                stream.height, stream.width = pixels.shape[0], pixels.shape[1]
                stream.pix_fmt = "yuv420p"
                stream.options = {"crf": QUALITY}
            for packet in stream.encode(_av().VideoFrame.from_ndarray(pixels, format="rgb24")):
                container.mux(packet)
        if stream is not None:
            # the encoder holds back some frames; encoding nothing gives them out
            for packet in stream.encode():
                container.mux(packet)


def _write_gif(file: Path, pictures: Iterator[Pixels], fps: float) -> None:
    # no dithering: its noise defeats the compression of GIF
    images: Sequence[Image.Image] = [
        Image.fromarray(pixels).quantize(128, dither=Image.Dither.NONE) for pixels in pictures
    ]
    wait_ms = max(round(1000.0 / fps), LEAST_GIF_MS)
    images[0].save(file, save_all=True, append_images=images[1:], duration=wait_ms, loop=0)


def _write_png(file: Path, pictures: Iterator[Pixels], fps: float) -> None:
    Image.fromarray(next(pictures)).save(file, optimize=True)


_WRITERS = {".png": _write_png, ".gif": _write_gif, ".mp4": _write_mp4}
