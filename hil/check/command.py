"""`loaderhil check`: deadline verdicts on a recording, or on the run directory of a real-time run."""

import json
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape

from dbc.errors import LogError
from dbc.protections import read_protections
from dbc.recordings.part import Part, WrongPartError
from dbc.tables import load_databases, protect
from hil.check.check import Check, Rules
from hil.check.observed import check_observed, observed
from hil.check.tables import COLOUR, several_channels, table_of
from hil.ending import Ending
from hil.results import Case, Suite, write_junit
from hil.shell.progress import reading_progress
from hil.timing.deadlines import STALE_AFTER, TOLERANCE
from hil.verdict import Result

WIDTH = 120
"""Columns that the table needs; used where standard output is not a terminal."""


def print_summary(console: Console, recording: Path, done: Check) -> None:
    """Print the verdicts as a table, and the messages and frames that were not judged."""
    seconds = (done.observer.end_ns - done.observer.start_ns) * 1e-9
    console.print(f"{recording}: {seconds:.3f} s judged")
    console.print(table_of(done.messages, channels=several_channels(done.messages)))
    if done.aperiodic:
        console.print(f"without a cycle time, not judged: {', '.join(done.aperiodic)}")
    if done.unknown:
        console.print(f"in no DBC, not judged: {done.unknown} frames")
    for note in done.notes:
        console.print(escape(note))
    for verdict in (done.overall, done.intact):
        colour = COLOUR[verdict.result]
        console.print(
            f"[{colour}]{verdict.result.value}[/]  {escape(verdict.question)}: {escape(verdict.reason)}"
        )


def as_json(recording: Path, done: Check) -> str:
    """Everything of the check, results by their names."""
    # the rows of the waits are data behind the reasons, not results
    observer = replace(done.observer, waits={})
    content: dict[str, Any] = {"recording": str(recording)} | asdict(replace(done, observer=observer))
    content["observer"].pop("waits")
    return json.dumps(content, indent=2, ensure_ascii=False, default=_name_of_result)


def suite_of(recording: Path, done: Check) -> Suite:
    """The verdict on each message, which decides nothing, then the verdicts on all of them, which decide."""
    several = several_channels(done.messages)
    messages = [
        Case(
            name=f"{one.channel}: {one.verdict.name}" if several else one.verdict.name,
            result=one.verdict.result,
            reason=one.verdict.reason,
            decides=False,
        )
        for one in done.messages
    ]
    seconds = (done.observer.end_ns - done.observer.start_ns) * 1e-9
    return Suite(
        name=str(recording),
        cases=(*messages, Case.of(done.overall), Case.of(done.intact)),
        time_s=seconds,
        remarks=done.notes,
    )


def _name_of_result(value: object) -> str:
    assert isinstance(value, Result)
    return str(value.value)


def check_recording(
    recording: Annotated[
        Path, typer.Argument(metavar="RECORDING", help="Recording or run directory to check.")
    ],
    dbc: Annotated[
        list[Path] | None,
        typer.Option(
            "--dbc",
            metavar="FILE",
            help="DBC file with the cycle times; by default the bench's own. Repeatable.",
        ),
    ] = None,
    node: Annotated[
        list[str] | None,
        typer.Option("--node", metavar="NAME", help="Check only messages that this node sends. Repeatable."),
    ] = None,
    channel: Annotated[
        str | None,
        typer.Option("--channel", metavar="NAME", help="Check only this channel of the recording."),
    ] = None,
    from_s: Annotated[
        float | None, typer.Option("--from-s", help="Check from this time on [s after the first frame].")
    ] = None,
    to_s: Annotated[
        float | None, typer.Option("--to-s", help="Check up to this time [s after the first frame].")
    ] = None,
    tolerance: Annotated[
        float,
        typer.Option(
            "--tolerance",
            min=0.01,
            max=0.99,
            help="Permitted deviation of an interval, as a share of the cycle time.",
        ),
    ] = TOLERANCE,
    stale_after: Annotated[
        float,
        typer.Option(
            "--stale-after", min=1, help="Number of cycle times without a frame after which a value is stale."
        ),
    ] = STALE_AFTER,
    protection: Annotated[
        Path | None,
        typer.Option(
            "--protection",
            metavar="FILE",
            help="Python file with counters and checksums that the DBC cannot describe.",
        ),
    ] = None,
    json_output: Annotated[bool, typer.Option("--json", help="Print the verdicts as JSON.")] = False,
    junit: Annotated[
        Path | None, typer.Option("--junit", metavar="FILE", help="The verdicts also as JUnit XML.")
    ] = None,
) -> None:
    """Check the timing of every message in a recording against its cycle time.

    Reports late, early, missing and repeated frames, jumps of counters, stale values, and frames of wrong length or CRC.
    Exit code 0: every message was judged, in time and intact; 1: one was not, or could not be judged. Example:
    `loaderhil check drive.blf --dbc car.dbc --from-s 10`
    """
    # not strict: signals that overlap do not matter here, and DBC files of third parties often have some
    databases = load_databases(dbc or [])
    if protection is not None:
        protect(databases, read_protections(protection))
    known = sorted({name for db in databases for codec in db.by_name.values() for name in codec.senders})
    for name in node or []:
        if name not in known:
            raise LogError(
                f"--node {name}: the DBC has no sender of that name; its senders are {', '.join(known)}"
            )
    rules = Rules(tolerance=tolerance, stale_after=stale_after, nodes=tuple(node or ()))
    part = Part(from_s=from_s, to_s=to_s, channel=channel)
    errors = Console(stderr=True, highlight=False, soft_wrap=True)
    try:
        with reading_progress(errors, recording.name) as progress:
            done = check_observed(observed(recording), databases, rules, part=part, progress=progress)
    except WrongPartError:
        raise
    except LogError as error:
        errors.print(f"loaderhil: {escape(str(error))}")
        # FAILED, not MISUSED: an unreadable recording is a result, and a build server must not take it for a wrong option
        raise typer.Exit(Ending.FAILED) from None
    if junit is not None:
        write_junit(junit, "check", [suite_of(recording, done)])
    if json_output:
        print(as_json(recording, done))
    else:
        # without a terminal rich assumes 80 columns and would cut the table
        width = None if sys.stdout.isatty() else WIDTH
        print_summary(Console(highlight=False, soft_wrap=True, width=width), recording, done)
    raise typer.Exit(Ending.PASSED if done.passed else Ending.FAILED)


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("check")(check_recording)
