"""`loaderhil render`: the command that draws a picture or a video of a run."""

from pathlib import Path
from typing import Annotated

import typer

from hil.ending import Ending
from report.render.camera import View

DEFAULT_FPS = 25.0
GIF_FPS = 12.5


def render(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run directory.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="A .png, .gif or .mp4 file; by default RUN/render.png."),
    ] = None,
    start: Annotated[
        float | None,
        typer.Option(
            "--from",
            metavar="S",
            help="Time to begin [s]; of a picture, its time: by default the lift-off or the smallest wheel load.",
        ),
    ] = None,
    end: Annotated[float | None, typer.Option("--to", metavar="S", help="Time to end [s].")] = None,
    fps: Annotated[
        float | None,
        typer.Option("--fps", min=1.0, max=100.0, help="Pictures per second; by default 25, in a GIF 12.5."),
    ] = None,
    view: Annotated[
        View, typer.Option("--view", help="Side from which the machine is seen.")
    ] = View.FRONT_LEFT,
    width: Annotated[
        int, typer.Option("--width", min=160, max=3840, help="Width in pixels; the format is 16:9.")
    ] = 960,
) -> None:
    """Draw a run: the machine, its wheel loads as arrows, the ECU's warning. No display needed.

    Examples: `loaderhil render out/loaded --view above`, `loaderhil render out/loaded --out drive.mp4 --from 2 --to 8`
    """
    from rich.console import Console
    from rich.progress import track

    from hil.rundir import RunDirectory
    from report.render.film import RenderError, Shot, checked, decisive_moment, frames, suffix_checked, write

    file = out or run / "render.png"
    suffix_checked(file)
    seen = checked(RunDirectory.read(run))
    still = file.suffix == ".png"
    first, last = (float(seen.truth["time_s"][i]) for i in (0, -1))
    if still:
        # a picture has one time; a film has two
        begin = decisive_moment(seen) if start is None else start
        finish = begin
    else:
        begin = first if start is None else start
        finish = last if end is None else end
    if not first <= begin <= finish <= last:
        raise RenderError(
            f"--from {begin:g} s --to {finish:g} s is not within the run, {first:g}..{last:g} s, in this order"
        )
    # even numbers: H.264 with 4:2:0 colour cannot hold odd ones
    size = (width - width % 2, width * 9 // 16 - width * 9 // 16 % 2)
    rate = fps or (GIF_FPS if file.suffix == ".gif" else DEFAULT_FPS)
    shot = Shot(start_s=begin, end_s=finish, fps=rate, view=view, size=size)
    drawn = track(
        frames(seen, shot),
        f"{file.name}",
        total=len(shot.times_s),
        console=Console(stderr=True),
        transient=True,
    )
    write(file, iter(drawn), rate)
    print(file)
    raise typer.Exit(Ending.PASSED)


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(render)
