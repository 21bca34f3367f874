"""`loaderhil decode`: recordings through DBC files into one table per message.

Frames that no DBC knows are counted and listed; damaged lines are reported with their number and skipped; of a frame
shorter than its message the signals that lie within it are decoded.
"""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from dbc.columns import ColumnDecoder
from dbc.errors import DatabaseError, LogError
from dbc.j1939 import identifier_text
from dbc.offline.decoding import Decoded, decode_log
from dbc.offline.writing import Tables
from dbc.tables import Format, TableError, load_databases
from hil.ending import Ending
from hil.shell.progress import reading_progress

SHOWN = 12


def print_summary(console: Console, done: Decoded) -> None:
    """Print the messages, unknown identifiers and damage of one recording."""
    table = Table(
        "message", "frames", "mean period \\[ms]", box=None, header_style="bold", title_justify="left"
    )
    for name, found in sorted(done.messages.items()):
        count, span = found.frames, found.last_s - found.first_s
        table.add_row(name, str(count), f"{span / (count - 1) * 1e3:.1f}" if count > 1 else "–")
    decoded = sum(found.frames for found in done.messages.values())
    console.print(f"{done.path}: {done.frames} frames, {decoded} decoded, {len(done.messages)} messages")
    console.print(table)
    if done.undecodable:
        total = sum(done.undecodable.values())
        console.print(f"in no DBC: {total} frames of {len(done.undecodable)} identifiers")
        ranked = sorted(done.undecodable.items(), key=lambda item: (-item[1], item[0]))
        for can_id, count in ranked[:SHOWN]:
            console.print(f"  {identifier_text(can_id)}, {count} frames")
        if len(ranked) > SHOWN:
            console.print(f"  and {len(ranked) - SHOWN} more")
    for name, count in done.short.items():
        decoded_too = name in done.messages and not done.messages[name].codec.is_multiplexed
        what = "signals outside them left empty" if decoded_too else "skipped"
        console.print(f"{name}: {count} frames shorter than the DBC says; {what}")
    for damage in done.damaged[:SHOWN]:
        console.print(f"{done.path}: {escape(str(damage))}")
    if done.damaged_count > SHOWN:
        console.print(f"{done.path}: {done.damaged_count} damaged lines in all")


def decode(
    logs: Annotated[
        list[Path],
        typer.Argument(metavar="LOG...", help="Recordings: candump log, .gz of one, BLF, ASC, MF4."),
    ],
    dbc: Annotated[
        list[Path] | None,
        typer.Option(
            "--dbc",
            metavar="FILE",
            help="DBC file, may be repeated. Default: our own and a few J1939 groups.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Folder for one table per message; by default only a summary is shown.",
        ),
    ] = None,
    form: Annotated[Format, typer.Option("--format", help="Format of the tables.")] = Format.CSV,
    channel: Annotated[
        str | None,
        typer.Option("--channel", metavar="NAME", help="Decode only this channel of the recordings."),
    ] = None,
    j1939: Annotated[
        bool,
        typer.Option(
            "--j1939",
            help="Match every 29-bit identifier by its J1939 parameter group; tables have a column for the source address.",
        ),
    ] = False,
) -> None:
    """Decode recordings into one table per message.

    J1939 messages are matched by their parameter group, from any source address. Example:
    `loaderhil decode drive.log --dbc car.dbc --out tables --format parquet`
    """
    # soft_wrap: long lines are not broken, so that grep finds them
    console = Console(highlight=False, soft_wrap=True)
    errors = Console(stderr=True, highlight=False, soft_wrap=True)
    try:
        decoder = ColumnDecoder(*load_databases(dbc or [], j1939=j1939))
    except DatabaseError as error:
        errors.print(f"loaderhil: {escape(str(error))}")
        raise typer.Exit(Ending.MISUSED) from None
    failed = False
    for log in logs:
        try:
            if out is None:
                done = _with_progress(log, decoder, errors, channel, None)
            else:
                with Tables(out, log, form, several=len(logs) > 1, j1939=j1939) as tables:
                    done = _with_progress(log, decoder, errors, channel, tables)
                    tables.finish()
        except (LogError, TableError) as error:
            errors.print(f"loaderhil: {escape(str(error))}")
            failed = True
            continue
        print_summary(console, done)
    if out is not None and not failed:
        console.print(f"tables: {out}")
    raise typer.Exit(Ending.FAILED if failed else Ending.PASSED)


def _with_progress(
    log: Path, decoder: ColumnDecoder, errors: Console, channel: str | None, tables: Tables | None
) -> Decoded:
    with reading_progress(errors, log.name) as progress:
        return decode_log(log, decoder, progress, channel, None if tables is None else tables.take)


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(decode)
