"""`loaderhil check`: deadline verdicts on a recording, or on the run directory of a real-time run."""

import json
import math
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from dbc import FOLDER
from dbc.database import Database
from dbc.errors import LogError
from dbc.logfile import FrameTable
from dbc.recording import read_frames
from hil import rundir
from hil.deadlines import STALE_AFTER, TOLERANCE, Observer
from hil.ending import Ending
from hil.judgement import timing_of
from hil.recording.check import Check, Rules, check, whole
from hil.timing import starvation
from hil.verdict import Result

DEFAULT_DBCS = ("loader.dbc", "reference.dbc", "j1939.dbc")
WIDTH = 120
"""Columns that the table needs: what a pipe gets."""
COLOUR = {Result.PASSED: "green", Result.FAILED: "red", Result.INCONCLUSIVE: "yellow"}


def read_observed(recording: Path) -> tuple[FrameTable, Observer]:
    """The frames and how far they can be trusted; of a run directory: the time in which its plant ticked."""
    if not recording.is_dir():
        table = read_frames(recording)
        return table, whole(table)
    run = rundir.RunDirectory.read(recording)
    table = read_frames(recording / rundir.BUS)
    realtime = run.record.mode == "realtime"
    observer = whole(table, starvation(timing_of(run)) if realtime else "")
    if "plant_due_ns" in run.timing and (due := run.timing["plant_due_ns"]).size:
        observer = replace(observer, start_ns=int(due[0]), end_ns=int(due[-1]))
    lost = observer.lost + int(run.record.statistics.get("recorder_dropped", 0))
    return table, replace(observer, lost=lost, unfinished=run.record.outcome != "finished")


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
    several = len({one.channel for one in done.messages}) > 1
    head = (*(["channel"] if several else []), "message", "T \\[ms]", "frames", "missing", "late", "early",
            "repeated", "jumps", "stale", "worst \\[ms]", "")  # fmt: skip
    table = Table(*head, box=None, header_style="bold")
    for one in done.messages:
        v = one.verdict
        colour = COLOUR[v.result]
        worst = "–" if math.isnan(v.worst_gap_ns) else f"{v.worst_gap_ns * 1e-6:.1f}"
        table.add_row(
            *([one.channel] if several else []), v.name, f"{(v.period_ns or 0) * 1e-6:g}", str(v.frames),
            *(str(count or "–") for count in (v.missing, v.late, v.early, v.duplicates, v.counter_jumps)),
            f"{100 * v.stale_share:.1f} %" if v.stale_share else "–", worst,
            f"[{colour}]{v.result.value}[/]",
        )  # fmt: skip
    seconds = (done.observer.end_ns - done.observer.start_ns) * 1e-9
    console.print(f"{recording}: {seconds:.3f} s judged")
    console.print(table)
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
    """Everything of the check, NaN as null, results by their names."""
    content: dict[str, Any] = {"recording": str(recording)} | asdict(done)
    return json.dumps(_plain(content), indent=2, ensure_ascii=False)


def _plain(value: Any) -> Any:
    match value:
        case dict():
            return {key: _plain(item) for key, item in value.items()}
        case list() | tuple():
            return [_plain(item) for item in value]
        case Result():
            return value.value
        case float() if math.isnan(value):
            return None
    return value


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
