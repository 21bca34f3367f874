"""Recordings as tables: CSV or Parquet with one column per channel, headed `name [unit]`, into the engine's signals.

Units are converted to the model's here and nowhere else. What is wrong with a file is told as complaints; an Unreadable is raised
only where no column can be trusted. An empty cell is no sample; a cell that is no number counts as damage.
"""

import csv
import gzip
import io
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from bus.mistake import Mistake
from discrepancy.model import Model
from discrepancy.recording import Array, Complaint, Recording, Signal
from discrepancy.units import parse_scaled, parse_unit

HEADING = re.compile(r"\s*(?P<name>[^\[]*?)\s*(?:\[(?P<unit>[^\]]*)\])?\s*$")
TIME = ("time", "t", "timestamp", "time_s", "timestamps")
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}
EPOCH_S = 1e6  # stamps beyond count from some distant day; the recording is told from its own start
SHOWN = 8

Advance = Callable[[int, int], None]


class Unreadable(Mistake, ValueError):
    """Nothing in the file can be used; the message says why and what would be right."""


@dataclass(frozen=True, slots=True)
class Column:
    """One column: values with NaN where there is no sample; damaged: cells that are no number, with the first's line."""

    name: str
    unit: str | None
    value: Array
    damaged: int = 0
    first_damaged: int = 0


@dataclass(frozen=True, slots=True)
class Table:
    """Columns of one file, constants from its head, and lines that were skipped."""

    columns: Sequence[Column]
    constants: Mapping[str, tuple[float, str | None]]
    skipped: Sequence[str] = ()


def heading(text: str) -> tuple[str, str | None]:
    """'speed [km/h]' -> ('speed', 'km/h'); 'time_s' -> ('time_s', None)."""
    match = HEADING.match(text)
    if match is None:
        return text.strip(), None
    return match["name"], match["unit"]


def is_table(path: Path) -> bool:
    """Whether the name is that of a table."""
    return path.name.lower().removesuffix(".gz").endswith((".csv", ".tsv", ".txt", ".parquet"))


def read_table(path: Path) -> Table:
    """A file as columns. Raises Unreadable."""
    try:
        found = _read_parquet(path) if path.suffix.lower() == ".parquet" else _read_csv(path)
    except (OSError, EOFError, UnicodeDecodeError, csv.Error, pa.ArrowException) as error:
        raise Unreadable(f"{path.name}: cannot be read: {_first_line(error)}") from error
    if not found.columns:
        raise Unreadable(f"{path.name}: is empty; a heading like 'time [s],speed [m/s]' and rows are needed")
    if found.columns[0].value.size == 0:
        raise Unreadable(f"{path.name}: has a heading but no rows")
    return found


def _first_line(error: Exception) -> str:
    text = str(error).splitlines()
    return text[0] if text else type(error).__name__


def _read_parquet(path: Path) -> Table:
    table = pq.read_table(path)
    columns = []
    for field, data in zip(table.schema, table.columns, strict=True):
        name, unit = heading(field.name)
        told = (field.metadata or {}).get(b"unit")
        unit = unit if unit is not None else told.decode() if told is not None else None
        if pa.types.is_timestamp(field.type):
            value, unit = np.asarray(data.cast(pa.timestamp("ns")).cast(pa.int64())).astype(float), "ns"
        elif (
            pa.types.is_integer(field.type)
            or pa.types.is_floating(field.type)
            or pa.types.is_boolean(field.type)
        ):
            value = np.asarray(data.cast(pa.float64()), float)
        else:
            continue
        columns.append(Column(name, unit, value))
    return Table(columns, {})


def _read_csv(path: Path) -> Table:
    raw = path.read_bytes()
    if path.suffix.lower() == ".gz":
        raw = gzip.decompress(raw)
    lines = io.StringIO(raw.decode("utf-8-sig"), newline="")
    constants: dict[str, tuple[float, str | None]] = {}
    number = 0
    for line in lines:
        number += 1
        if line.startswith("#"):
            constants |= _constant(line)
        elif line.strip():
            break
    else:
        return Table((), constants)
    separator = max(",;\t", key=line.count)
    decimal = "," if separator == ";" else "."
    names = next(csv.reader([line], delimiter=separator))
    cells, skipped = _rows(csv.reader(lines, delimiter=separator), len(names), number)
    lines_of = [number for number, _ in cells]
    columns = [
        _column(name, [row[i] for _, row in cells], decimal, lines_of)
        for i, name in enumerate(names)
        if name.strip()
    ]
    return Table(columns, constants, skipped)


def _constant(line: str) -> dict[str, tuple[float, str | None]]:
    """'# mass [kg] = 0.058' is a constant of the recording; any other comment is none."""
    left, equals, right = line.lstrip("#").partition("=")
    try:
        value = float(right)
    except ValueError:
        return {}
    name, unit = heading(left)
    return {name: (value, unit)} if equals else {}


def _rows(
    reader: Iterator[list[str]], width: int, before: int
) -> tuple[list[tuple[int, list[str]]], list[str]]:
    kept: list[tuple[int, list[str]]] = []
    skipped: list[str] = []
    for number, row in enumerate(reader, start=before + 1):
        if len(row) == width:
            kept.append((number, row))
        elif row:
            skipped.append(f"line {number} has {len(row)} of {width} cells")
    return kept, skipped


def _column(title: str, cells: Sequence[str], decimal: str, lines: Sequence[int]) -> Column:
    name, unit = heading(title)
    value, damaged, first = np.full(len(cells), np.nan), 0, 0
    for i, cell in enumerate(cells):
        text = cell.strip().replace(decimal, ".") if decimal != "." else cell
        try:
            value[i] = float(text)
        except ValueError:
            if text.strip():
                damaged += 1
                first = first or lines[i]
    return Column(name, unit, value, damaged, first)


def to_recording(
    table: Table, name: str, model: Model, renamed: Mapping[str, str] | None = None
) -> tuple[Recording, list[Complaint]]:
    """The columns a model knows, in its units. renamed: channel of the model -> column of the file."""
    complaints = [Complaint(name, "", text) for text in table.skipped[:SHOWN]]
    if len(table.skipped) > SHOWN:
        complaints.append(Complaint(name, "", f"{len(table.skipped)} damaged lines in all; skipped"))
    time_s = _stamps(table, name)
    by_name = {c.name: c for c in table.columns}
    signals: dict[str, Signal] = {}
    for channel, unit in {**model.inputs, **model.optional, **model.outputs}.items():
        column = by_name.get((renamed or {}).get(channel, channel))
        if column is None:
            continue
        values, told_unit, said = _converted(column, channel, unit, name)
        complaints += said
        if any(c.fatal for c in said):
            continue
        there = ~np.isnan(values) | _told_as_not_a_number(column)
        signals[channel] = Signal(time_s[there], values[there], told_unit, channel in model.held)
    gone = [column for column in (renamed or {}).values() if column not in by_name]
    if gone:
        complaints.append(
            Complaint(name, "", f"has no column {', '.join(gone)}; {_columns(table)}", fatal=True)
        )
    elif not any(channel in signals for channel in model.outputs):
        complaints.append(
            Complaint(name, "", f"{_columns(table)}; --channel NAME=COLUMN says which is which")
        )
    constants, said = _constants(table, name, model)
    return Recording(name, signals, constants), complaints + said


def _told_as_not_a_number(column: Column) -> NDArray[np.bool_]:
    """Cells that are damage and not merely empty: a column that is filled in nearly every row has no empty ones by design."""
    missing = np.isnan(column.value)
    return (
        missing
        if np.count_nonzero(missing) < 0.5 * missing.size or missing.all()
        else np.zeros(missing.size, bool)
    )


def _columns(table: Table) -> str:
    names = [c.name for c in table.columns]
    return f"has the columns {', '.join(names[:30])}{' ...' if len(names) > 30 else ''}"


def _stamps(table: Table, name: str) -> Array:
    for column in table.columns:
        if column.name.lower() not in TIME:
            continue
        unit = column.unit or "s"
        if unit not in TIME_UNITS:
            raise Unreadable(f"{name}: time is in '{unit}'; known are {', '.join(TIME_UNITS)}")
        if np.isnan(column.value).all():
            raise Unreadable(f"{name}: the column {column.name} holds no numbers")
        stamps = column.value * TIME_UNITS[unit]
        first = float(np.nanmin(stamps))
        return np.asarray(stamps - first if abs(first) > EPOCH_S else stamps, float)
    raise Unreadable(
        f"{name}: no column of time; one must be headed 'time [s]', 'time_s' or 't [ms]'; {_columns(table)}"
    )


def _converted(column: Column, channel: str, unit: str, name: str) -> tuple[Array, str, list[Complaint]]:
    complaints = []
    if column.damaged:
        text = f"{column.damaged} of {column.value.size} cells are no numbers, the first in line {column.first_damaged}"
        complaints.append(Complaint(name, channel, text))
    if column.unit is None:
        complaints.append(Complaint(name, channel, f"has no unit in its heading; taken as {unit}"))
        return column.value, unit, complaints
    try:
        scaled = parse_scaled(column.unit)
    except ValueError as error:
        complaints.append(Complaint(name, channel, str(error), fatal=True))
        return column.value, unit, complaints
    if not scaled.unit.same_quantity(parse_unit(unit)):
        return column.value, str(scaled.unit), complaints
    return column.value * scaled.factor, unit, complaints


def _constants(table: Table, name: str, model: Model) -> tuple[dict[str, float], list[Complaint]]:
    constants, complaints = {}, []
    for key, (value, unit) in table.constants.items():
        needed = model.constants.get(key)
        if needed is None or unit is None:
            constants[key] = value
            continue
        scaled = parse_scaled(unit)
        if not scaled.unit.same_quantity(parse_unit(needed)):
            complaints.append(Complaint(name, key, f"is in {unit}, the model needs {needed}", fatal=True))
        constants[key] = value * scaled.factor
    return constants, complaints
