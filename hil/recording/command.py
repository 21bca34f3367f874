"""`loaderhil record`: the options of the command that records buses into a file."""

from pathlib import Path
from typing import Annotated

import typer

from hil.recording.formats import check_suffix
from hil.recording.ring import SLOTS

MEBIBYTE = 1 << 20


def record(
    buses: Annotated[
        list[str],
        typer.Argument(
            metavar="BUS...",
            help="Addresses of buses (hub:PATH, socketcan:INTERFACE), each alone or as NAME=ADDRESS. NAME is the channel's name in the file.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            metavar="FILE",
            help="File to write. Its suffix chooses the format: .log, .blf, .asc or .mf4.",
        ),
    ],
    duration_s: Annotated[
        float | None,
        typer.Option("--duration-s", min=0.001, help="End after this time [s]; by default at Ctrl-C."),
    ] = None,
    rotate_mib: Annotated[
        float, typer.Option("--rotate-mib", min=0, help="Start a new file after this size [MiB]; 0: never.")
    ] = 0,
    rotate_s: Annotated[
        float, typer.Option("--rotate-s", min=0, help="Start a new file after this time [s]; 0: never.")
    ] = 0,
    flush_s: Annotated[
        float,
        typer.Option(
            "--flush-s", min=0.01, max=60, help="Longest time until a received frame is in the file [s]."
        ),
    ] = 0.2,
    ring_frames: Annotated[
        int,
        typer.Option(
            "--ring-frames", min=64, max=1 << 24, help="Number of frames that can wait to be written."
        ),
    ] = SLOTS,
    monotonic: Annotated[
        bool,
        typer.Option(
            "--monotonic", help="Time stamps of the computer's monotonic clock instead of wall-clock time."
        ),
    ] = False,
) -> None:
    """Record every frame of one or several buses, until Ctrl-C.

    If the recorder is killed, the file is complete up to its last flush. Examples:
    `loaderhil record socketcan:can0 --out drive.blf`,
    `loaderhil record loader=hub:/tmp/loaderhil.hub ref=socketcan:can1 --out drive.mf4 --rotate-s 600`
    """
    from bus.socketcan.wallclock import SHARED
    from hil.recording import capture
    from hil.recording.files import Plan
    from hil.shell.process import ending_of

    check_suffix(out)
    sources = capture.parse_sources(buses)
    plan = Plan(
        path=out,
        channels=tuple(source.name for source in sources),
        # buses stamp with the monotonic clock; other tools expect wall-clock time
        offset_ns=0 if monotonic else SHARED.ahead_ns,
        flush_s=flush_s,
        rotate_bytes=round(rotate_mib * MEBIBYTE),
        rotate_ns=round(rotate_s * 1e9),
    )
    addresses = [source.address for source in sources]
    raise typer.Exit(
        ending_of(lambda line: capture.run(line, addresses, plan, duration_s=duration_s, slots=ring_frames))
    )


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(record)
