"""`loaderhil check`: deadline verdicts on a recording, or on the run directory of a real-time run."""

import json
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape

from dbc import FOLDER
from dbc.database import Database
from dbc.errors import LogError
from hil.deadlines import STALE_AFTER, TOLERANCE, Observer
from hil.ending import Ending
from hil.recording.check import Check, Rules, check
from hil.recording.observed import read_observed
from hil.recording.tables import COLOUR, several_channels, table_of
from hil.verdict import Result

DEFAULT_DBCS = ("loader.dbc", "reference.dbc", "j1939.dbc")
WIDTH = 120
"""Columns that the table needs: what a pipe gets."""


def windowed(observer: Observer, from_s: float | None, to_s: float | None) -> Observer:
    """The window narrowed to seconds after its start; LogError if nothing is left of it."""
    start_ns, end_ns = observer.start_ns, observer.end_ns
    begin_ns = start_ns + round(from_s * 1e9) if from_s is not None else start_ns
    stop_ns = min(start_ns + round(to_s * 1e9), end_ns) if to_s is not None else end_ns
    if begin_ns >= stop_ns:
        length_s = (end_ns - start_ns) * 1e-9
        raise LogError(
            f"--from-s {from_s} to --to-s {to_s}: nothing to judge there; there are {length_s:.3f} s"
        )
    return replace(observer, start_ns=begin_ns, end_ns=stop_ns)


def tell(console: Console, recording: Path, done: Check) -> None:
    """The verdicts as a table, and what was not judged."""
    seconds = (done.observer.end_ns - done.observer.start_ns) * 1e-9
    console.print(f"{recording}: {seconds:.3f} s judged")
    console.print(table_of(done.messages, channels=several_channels(done.messages)))
    if done.aperiodic:
        console.print(f"without a cycle time, not judged: {', '.join(done.aperiodic)}")
    if done.unknown:
        console.print(f"in no DBC, not judged: {done.unknown} frames")
    for note in done.notes:
        console.print(escape(note))
    colour = COLOUR[done.overall.result]
    console.print(
        f"[{colour}]{done.overall.result.value}[/]  {done.overall.question}: {escape(done.overall.reason)}"
    )


def as_json(recording: Path, done: Check) -> str:
    """Everything of the check, results by their names."""
    content: dict[str, Any] = {"recording": str(recording)} | asdict(done)
    return json.dumps(content, indent=2, ensure_ascii=False, default=_name_of_result)


def _name_of_result(value: object) -> str:
    assert isinstance(value, Result)
    return str(value.value)


def check_recording(
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="Recording, or a run directory.")],
    dbc: Annotated[
        list[Path] | None,
        typer.Option(
            "--dbc", metavar="FILE", help="DBC with the cycle times, may be repeated. Default: our own."
        ),
    ] = None,
    node: Annotated[
        list[str] | None,
        typer.Option("--node", metavar="NAME", help="Judge only what this node sends; may be repeated."),
    ] = None,
    channel: Annotated[
        str | None, typer.Option("--channel", metavar="NAME", help="Only this channel of the recording.")
    ] = None,
    from_s: Annotated[
        float | None, typer.Option("--from-s", help="Judge from here, after the start.")
    ] = None,
    to_s: Annotated[float | None, typer.Option("--to-s", help="Judge up to here, after the start.")] = None,
    tolerance: Annotated[
        float,
        typer.Option("--tolerance", min=0.01, max=0.99, help="Permitted deviation, share of the cycle time."),
    ] = TOLERANCE,
    stale_after: Annotated[
        float,
        typer.Option("--stale-after", min=1, help="Cycle times without a frame that make a value stale."),
    ] = STALE_AFTER,
    json_output: Annotated[
        bool, typer.Option("--json", help="The verdicts as JSON on standard output.")
    ] = False,
) -> None:
    """Did every message keep its cycle time: late, early, missing, repeated, counter jumps, stale.

    Exit code 0 only when everything was judged and in time; 1 when not, or when it could not be judged. Example:
    `loaderhil check drive.blf --dbc car.dbc --from-s 10`
    """
    databases = [Database.from_file(file, strict=False) for file in dbc or [FOLDER / d for d in DEFAULT_DBCS]]
    known = sorted({name for db in databases for codec in db.by_name.values() for name in codec.senders})
    for name in node or []:
        if name not in known:
            raise LogError(
                f"--node {name}: no node of the DBC sends under that name; there are {', '.join(known)}"
            )
    try:
        table, observer = read_observed(recording)
    except LogError as error:
        Console(stderr=True, highlight=False, soft_wrap=True).print(f"loaderhil: {escape(str(error))}")
        raise typer.Exit(Ending.FAILED) from None
    if channel is not None:
        table = table.on_channel(channel, recording)
    rules = Rules(tolerance=tolerance, stale_after=stale_after, nodes=tuple(node or ()))
    done = check(table, databases, rules, observer=windowed(observer, from_s, to_s))
    if json_output:
        print(as_json(recording, done))
    else:
        width = None if sys.stdout.isatty() else WIDTH
        tell(Console(highlight=False, soft_wrap=True, width=width), recording, done)
    raise typer.Exit(Ending.PASSED if done.overall.result is Result.PASSED else Ending.FAILED)


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("check")(check_recording)
