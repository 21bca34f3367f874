"""`loaderhil export`: decoded recordings as MCAP, which Foxglove and PlotJuggler open.

One topic per message, its signals as JSON under a JSON schema that has the DBC's units and comments.
"""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, BinaryIO

import numpy as np
import typer

from bus.user_error import UserError
from dbc.columns import ColumnDecoder, Columns
from dbc.database import Database
from dbc.recordings.logfile import FrameTable


class ExportError(UserError, OSError):
    """The file cannot be written, or nothing could be in it."""


def write_mcap(table: FrameTable, databases: Sequence[Database], out: BinaryIO) -> dict[str, int]:
    """Every frame that a DBC knows, in the order of time; frames by message. ExportError if there is none."""
    try:
        # an extra of the package: of all commands only this one needs it
        from mcap.writer import CompressionType, Writer
    except ModuleNotFoundError as error:
        raise ExportError("MCAP needs the package mcap: pip install loaderhil[export]") from error

    decoded = ColumnDecoder(*databases).decode(table)
    if not decoded:
        raise ExportError("no frame of the recording is in any DBC (name it with --dbc)")
    # LZ4 is there with the reader of MF4; zstd would be one more library for a tenth less space.
    writer = Writer(out, compression=CompressionType.LZ4)
    writer.start(profile="", library="loaderhil")
    channels = {}
    for name, columns in decoded.items():
        # every schema before the first sample: readers list the topics without reading the whole file
        schema = writer.register_schema(
            name=name, encoding="jsonschema", data=json.dumps(schema_of(columns)).encode()
        )
        channels[name] = writer.register_channel(topic=f"/{name}", message_encoding="json", schema_id=schema)
    # across messages, in the order of time: players read a file from front to back and never sort
    for sequence, (name, at_ns, values) in enumerate(_samples(decoded, table)):
        data = json.dumps(values).encode()
        writer.add_message(channels[name], log_time=at_ns, publish_time=at_ns, data=data, sequence=sequence)
    writer.finish()
    return {name: int(columns.rows.size) for name, columns in decoded.items()}


def schema_of(columns: Columns) -> dict[str, Any]:
    """JSON schema of a message: a number per signal, described by its unit, comment and value table."""
    properties = {}
    for signal in columns.codec.layout:
        names = ", ".join(f"{value} {name}" for value, name in sorted(signal.choices.items()))
        # JSON Schema has no keyword for units, so the unit is the first word of the description
        words = [f"[{signal.unit}]" if signal.unit else "", signal.comment, names]
        properties[signal.name] = {"type": "number", "description": " ".join(word for word in words if word)}
    return {
        "type": "object",
        "title": columns.codec.name,
        "description": columns.codec.comment,
        "properties": properties,
    }


def _samples(decoded: dict[str, Columns], table: FrameTable) -> Iterator[tuple[str, int, dict[str, float]]]:
    """Message, stamp [ns] and signals of each frame, by time; a multiplexed signal that a frame lacks is left out."""
    names = list(decoded)
    rows = np.concatenate([decoded[name].rows for name in names])
    which = np.repeat(np.arange(len(names)), [decoded[name].rows.size for name in names])
    place = np.concatenate([np.arange(decoded[name].rows.size) for name in names])
    # by the table's stamps and not by its rows: a log of several channels need not be in order
    for k in np.argsort(table.time_ns[rows], kind="stable").tolist():
        columns, at = decoded[names[which[k]]], int(place[k])
        values = {signal: column[at] for signal, column in columns.signals.items()}
        # NaN (v != v) is no JSON: the signal is left out. Flags and counters stay whole numbers
        present = {s: int(v) if float(v).is_integer() else float(v) for s, v in values.items() if v == v}
        yield names[which[k]], int(table.time_ns[rows[k]]), present


def export(
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="Recording or run directory.")],
    out: Annotated[
        Path, typer.Option("--out", metavar="FILE.mcap", help="File to write; an older one is replaced.")
    ],
    dbc: Annotated[
        list[Path] | None,
        typer.Option("--dbc", metavar="FILE", help="DBC file; by default the bench's own. Repeatable."),
    ] = None,
) -> None:
    """Write a decoded recording as MCAP, for Foxglove and PlotJuggler.

    Example: `loaderhil export drive.blf --dbc car.dbc --out drive.mcap`
    """
    from dbc import loader_database, reference_database
    from dbc.recordings.reading import read_frames
    from hil.rundir import BUS, writing

    # not strict: a DBC of somebody else may have faults in messages that this recording does not hold
    databases = [Database.from_file(file, strict=False) for file in dbc or []]
    table = read_frames(recording / BUS if recording.is_dir() else recording)
    # beside the target, so that the rename at the end stays on one file system: a cut export leaves no half file
    part = out.with_name(f".{out.name}.part")
    with writing(out):
        out.parent.mkdir(parents=True, exist_ok=True)
        try:
            with part.open("wb") as file:
                counts = write_mcap(table, databases or [loader_database(), reference_database()], file)
            part.replace(out)
        finally:
            part.unlink(missing_ok=True)
    print(f"{out}: {sum(counts.values())} of {len(table)} frames, {len(counts)} messages")


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(export)
