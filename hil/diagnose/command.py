"""`loaderhil diagnose`: what physics did the simulation leave out, told from recordings.

Exit codes: 0 explained, or nothing missing; 1 unknown: something is missing that the library does not name;
2 misused; 5 inconclusive: these recordings cannot tell.
"""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.ending import Ending

if TYPE_CHECKING:
    from rich.console import Console

    from discrepancy.search import Progress

INCONCLUSIVE = 5
EXIT = {
    "explained": int(Ending.PASSED),
    "nothing missing": int(Ending.PASSED),
    "unknown": int(Ending.FAILED),
    "inconclusive": INCONCLUSIVE,
}

EPILOG = (
    "Exit codes: 0 explained, or nothing missing; 1 unknown: something is missing that the library does not name; "
    "2 misused; 5 inconclusive: these recordings cannot tell; 130 interrupted."
)


def diagnose(
    recordings: Annotated[
        list[Path],
        typer.Argument(metavar="RECORDING...", help="Tables (.csv, .csv.gz, .parquet) headed `name [unit]`."),
    ],
    model: Annotated[
        str,
        typer.Option(
            "--model",
            metavar="NAME|FILE.py",
            help="ball, car, road, straight, or a file that defines `model`.",
        ),
    ],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Write findings.json here.")
    ] = None,
    part: Annotated[
        str | None, typer.Option("--part", metavar="PART", help="Which part of a published data set.")
    ] = None,
    channel: Annotated[
        list[str] | None,
        typer.Option(
            "--channel",
            metavar="NAME=COLUMN",
            help="Which column a channel of the model is; may be repeated.",
        ),
    ] = None,
    constant: Annotated[
        list[str] | None,
        typer.Option(
            "--constant",
            metavar="NAME=VALUE",
            help="Constant of the recordings: `mass [g]=58`; may be repeated.",
        ),
    ] = None,
    shift: Annotated[
        list[str] | None,
        typer.Option(
            "--shift", metavar="NAME=SECONDS", help="Add to the stamps of a channel; may be repeated."
        ),
    ] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="List every candidate, not the best twelve.")
    ] = False,
) -> None:
    """Find what a model leaves out: where it and the recordings differ, the effect's name and size, or that nothing is missing.

    Example: `loaderhil diagnose drive.csv --model straight --out out/diagnosis`
    """
    from rich.console import Console

    from discrepancy.examine import examine
    from discrepancy.findings import to_json
    from discrepancy.search import Settings
    from discrepancy.words import tell
    from hil.diagnose.models import find_model
    from hil.diagnose.reading import Ask, numbers, pairs, read_all

    choice = find_model(model)
    ask = Ask(
        paths=recordings,
        part=part,
        renamed=pairs("--channel", channel or []),
        shifts=numbers("--shift", shift or []),
        constants=numbers("--constant", constant or []),
    )
    with told_progress(Console(stderr=True)) as progress:
        read = read_all(choice, ask, progress)
        built = choice.build(read.recordings)
        result = examine(built, read.recordings, Settings(), progress, read.complaints)
    tell(result, Console(soft_wrap=True), all_candidates=everything)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        (out / "findings.json").write_text(to_json(result), encoding="utf-8")
        print(f"written: {out / 'findings.json'}")
    raise typer.Exit(EXIT[result.status])


@contextmanager
def told_progress(console: "Console") -> "Iterator[Progress]":
    """What is being done: one changing line on a terminal, a line per step with its second elsewhere."""
    start = time.monotonic()
    if console.is_terminal:
        with console.status("starting") as status:
            yield lambda text: status.update(f"{text} [dim]{time.monotonic() - start:.0f} s[/]")
        return
    yield lambda text: print(f"{time.monotonic() - start:6.1f} s  {text}", file=sys.stderr, flush=True)


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command(epilog=EPILOG)(diagnose)
