"""Recordings decoded through DBC files, and each message of them as a table in CSV or Parquet.

Values are the DBC's physical values, equal to cantools' bit for bit.
"""

import csv
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from bus.frame import EXTENDED
from bus.user_error import UserError
from dbc import FOLDER
from dbc.columns import ColumnDecoder, Columns
from dbc.database import Database
from dbc.j1939 import pgn, source_address
from dbc.recordings.logfile import FrameTable
from dbc.recordings.reading import read_frames

DEFAULT_DBCS = ("loader.dbc", "reference.dbc", "j1939.dbc")


class Format(StrEnum):
    """The file format of the tables."""

    CSV = "csv"
    PARQUET = "parquet"


@dataclass(frozen=True, slots=True, kw_only=True)
class Decoded:
    """One recording, decoded."""

    path: Path
    frames: FrameTable
    columns: dict[str, Columns]  # by message
    undecodable: dict[int, int]  # can_id word -> frames that no DBC knows
    short: dict[str, int]  # message -> frames shorter than the DBC says


def decode_log(
    path: Path,
    decoder: ColumnDecoder,
    progress: Callable[[int, int], None] | None = None,
    channel: str | None = None,
) -> Decoded:
    """Read and decode one recording, or one channel of it; LogError when it cannot be read, or has no such channel."""
    table = read_frames(path, progress)
    table = table.on_channel(channel, path) if channel is not None else table
    return Decoded(
        path=path,
        frames=table,
        columns=decoder.decode(table, truncated=True),
        undecodable=decoder.undecodable(table),
        short=decoder.short(table),
    )


def origins(columns: Columns, table: FrameTable, *, j1939: bool) -> dict[str, Any]:
    """Where each frame of a message came from: its channel if there are several, its source address in J1939."""
    found: dict[str, Any] = {}
    if len(table.channels) > 1:
        found["channel"] = np.array(table.channels)[table.channel[columns.rows]]
    if j1939:
        found["source_address"] = np.array(
            [source_address(word) for word in table.can_id[columns.rows].tolist()]
        )
    return found


class TableError(UserError, OSError):
    """A table cannot be written; the message names the file and the cause."""


@contextmanager
def naming_the_file(target: Path) -> Iterator[None]:
    """Turn an OSError while `target` is written into a TableError that names the file.

    The error of write(2) on a full disk names no file.
    """
    try:
        yield
    except OSError as error:
        raise TableError(f"{target}: cannot be written: {error.strerror or error}") from error


def write_columns(columns: Columns, target: Path, form: Format, origin: dict[str, Any] | None = None) -> None:
    """One message as a table: time_s, `origin`, then each signal named `Signal [unit]`; all of it or nothing."""
    origin = origin or {}
    units = {name: columns.codec.by_signal[name].unit for name in columns.signals}
    headers = ["time_s", *origin, *(f"{name} [{unit}]" if unit else name for name, unit in units.items())]
    values = [columns.time_s, *origin.values(), *columns.signals.values()]
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=target.parent, prefix=f".{target.name}.", delete=False) as handle:
        part = Path(handle.name)
    try:
        if form is Format.CSV:
            _write_csv(part, headers, values)
        else:
            _write_parquet(part, columns, units, origin)
        # a NamedTemporaryFile is readable by its owner only
        part.chmod(0o644)
        part.replace(target)
    finally:
        part.unlink(missing_ok=True)


def _write_csv(path: Path, headers: Sequence[str], values: Sequence[Any]) -> None:
    """Numbers in their shortest form that reads back to the same value."""
    with path.open("w", encoding="utf-8", newline="") as stream:
        out = csv.writer(stream, lineterminator="\n")
        out.writerow(headers)
        out.writerows(zip(*(column.tolist() for column in values), strict=True))


def _write_parquet(path: Path, columns: Columns, units: dict[str, str], origin: dict[str, Any]) -> None:
    """Columns under their plain names; units and the message's comment as field and table metadata."""
    fields = [pa.field("time_s", pa.float64(), metadata={"unit": "s"})]
    arrays: list[Any] = [pa.array(columns.time_s)]
    for name, values in origin.items():
        arrays.append(pa.array(values))
        fields.append(pa.field(name, arrays[-1].type))
    for name, values in columns.signals.items():
        # integers beyond 64 bits have no type in Parquet: as floats, rounded
        plain = np.array([float(v) for v in values]) if values.dtype == object else values
        arrays.append(pa.array(plain))
        fields.append(pa.field(name, arrays[-1].type, metadata={"unit": units[name]}))
    schema = pa.schema(fields, metadata={"message": columns.codec.name, "comment": columns.codec.comment})
    pq.write_table(pa.Table.from_arrays(arrays, schema=schema), path)


def load_databases(files: Iterable[Path], *, j1939: bool = False) -> list[Database]:
    """The DBC files in the order given; without any, our own and a few J1939 groups.

    j1939: every message with a 29-bit identifier stands for its parameter group, marked so or not.
    """
    named = list(files) or [FOLDER / name for name in DEFAULT_DBCS]
    databases = [Database.from_file(file, strict=False) for file in named]
    for database in databases if j1939 else ():
        extended = [codec for codec in database.by_id.values() if codec.can_id & EXTENDED]
        database.by_pgn = {pgn(codec.can_id): codec for codec in reversed(extended)}
    return databases


def target_of(out: Path, log: Path, message: str, form: Format, *, several: bool) -> Path:
    """Where a message's table goes: in a folder per recording when there are several."""
    stem = log.name.removesuffix(".gz")
    for suffix in (".log", ".candump", ".blf", ".asc", ".mf4"):
        stem = stem.removesuffix(suffix)
    return (out / stem if several else out) / f"{message}.{form}"
