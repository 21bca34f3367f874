"""Reads tables: CSV or Parquet with one column per channel, headed `name [unit]`, and one column of time.

An Unreadable is raised only where no column can be trusted. An empty cell means that there is no sample; a cell that is not a number counts
as damage.
"""

import codecs
import csv
import gzip
import io
import re
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from bus.user_error import UserError
from discrepancy.signals.recording import Array
from discrepancy.signals.units import parse_scaled

HEADING = re.compile(r"\s*(?P<name>[^\[]*?)\s*(?:\[(?P<unit>[^\]]*)\])?\s*$")
WORDS = re.compile(r"[^A-Za-zµ]+")
TIME = frozenset(
    {
        "time",
        "t",
        "timestamp",
        "timestamps",
        "zeit",
        "tiempo",
        "seconds",
        "sec",
        "secs",
        "elapsed",
    }
    | {"elapsed time", "time since start", "time stamp", "rel time", "relative time", "log time"}
)
"""Usual names of the time column in lower case, without the unit that may follow ('time_ms', 'Time Stamp', 't (s)')."""
BEGINNING = 1024  # bytes at the start of a file: a zero byte among them means that it is not text
GZIP = 16 + zlib.MAX_WBITS  # window size plus 16: zlib then expects the header of gzip
TIME_UNITS = {
    "s": 1.0,
    "sec": 1.0,
    "seconds": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
    "µs": 1e-6,
    "ns": 1e-9,
    "min": 60.0,
    "h": 3600.0,
}


class Unreadable(UserError, ValueError):
    """Nothing in the file can be used; the message gives the reason and the remedy."""


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a file, at the rows where it has a sample."""

    name: str
    unit: str | None  # of the heading; None where it has none
    time_s: Array
    value: Array  # in `unit`; NaN where a cell is damaged
    damage: str = ""  # a sentence on damaged samples


@dataclass(frozen=True, slots=True)
class Table:
    """The content of one file."""

    columns: Sequence[Column]
    constants: Mapping[str, tuple[float, str | None]]  # value and unit by name, from '#' lines at the head
    skipped: Sequence[str] = ()  # one sentence per damaged place


@dataclass(frozen=True, slots=True)
class _Raw:
    """A column before the time column is known."""

    name: str
    unit: str | None
    value: Array
    there: NDArray[np.bool_]  # rows with a sample
    damage: str = ""


_Found = tuple[list[_Raw], dict[str, tuple[float, str | None]], list[str]]


def heading(text: str) -> tuple[str, str | None]:
    """'speed [km/h]' -> ('speed', 'km/h'); 'time_s' -> ('time_s', None)."""
    match = HEADING.match(text)
    if match is None:
        return text.strip(), None
    return match["name"], match["unit"]


def is_table(path: Path) -> bool:
    """Whether the file name ends like that of a table."""
    return path.name.lower().removesuffix(".gz").endswith((".csv", ".tsv", ".txt", ".parquet"))


def read_table(path: Path, time: tuple[str, str | None] | None = None) -> Table:
    """The columns of a file. time: name and unit of the time column, None to find it by its usual names. Raises Unreadable."""
    try:
        if path.stat().st_size == 0:
            raise Unreadable(f"{path.name}: is empty (0 bytes)")
        found = _read_parquet(path) if path.suffix.lower() == ".parquet" else _read_csv(path)
    except (OSError, EOFError, UnicodeDecodeError, csv.Error, zlib.error, pa.ArrowException) as error:
        raise Unreadable(f"{path.name}: cannot be read: {_first_line(error)}") from error
    raw, constants, skipped = found
    if not raw:
        raise Unreadable(f"{path.name}: is empty; a heading like 'time [s],speed [m/s]' and rows are needed")
    clock = _clock(raw, path.name, time)
    time_s = _stamps(clock, path.name)
    columns = [
        Column(r.name, r.unit, time_s[r.there], r.value[r.there], r.damage)
        for r in raw
        if r.name != clock.name
    ]
    return Table(columns, constants, skipped)


def _first_line(error: Exception) -> str:
    text = str(error).splitlines()
    return text[0] if text else type(error).__name__


def _read_parquet(path: Path) -> _Found:
    # checksums: a damaged page would otherwise decode to wrong numbers without any error
    table = pq.read_table(path, page_checksum_verification=True)
    columns = []
    for field, data in zip(table.schema, table.columns, strict=True):
        name, unit = heading(field.name)
        stored = (field.metadata or {}).get(b"unit")
        unit = unit if unit is not None else stored.decode() if stored is not None else None
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
        columns.append(_Raw(name, unit, value, np.asarray(data.is_valid(), bool)))
    return columns, {}, []


def _read_csv(path: Path) -> _Found:
    raw, cut = path.read_bytes(), list[str]()
    if path.suffix.lower() == ".gz":
        raw, cut = _unpacked(raw)
    text, doubtful = _text(raw, path.name)
    lines = io.StringIO(text, newline="")
    constants: dict[str, tuple[float, str | None]] = {}
    number = 0
    for line in lines:
        number += 1
        if line.startswith("#"):
            constants |= _constant(line)
        elif line.strip():
            break
    else:
        return [], constants, []
    separator = max(",;\t", key=line.count)
    # spreadsheets in countries with a decimal comma separate cells by semicolons
    decimal = "," if separator == ";" else "."
    names = next(csv.reader([line], delimiter=separator))
    if all(_is_number(name, decimal) for name in names):
        raise Unreadable(
            f"{path.name}: has no heading, line {number} contains numbers; a heading looks like 'time [s],speed [m/s]'"
        )
    cells, skipped = _rows(csv.reader(lines, delimiter=separator), len(names), number)
    if cells and _are_units(cells[0][1], names, decimal):
        names = [
            f"{name} [{unit.strip()}]" if unit.strip() else name
            for name, unit in zip(names, cells.pop(0)[1], strict=True)
        ]
    lines_of = [number for number, _ in cells]
    columns = [
        _column(name, [row[i] for _, row in cells], decimal, lines_of)
        for i, name in enumerate(names)
        if name.strip()
    ]
    return columns, constants, [*cut, *doubtful, *skipped]


def _unpacked(raw: bytes) -> tuple[bytes, list[str]]:
    """The content of a gzip file; of one that is cut off, up to its last complete line. Raises OSError or zlib.error for other damage."""
    try:
        return gzip.decompress(raw), []
    except EOFError:
        whole = zlib.decompressobj(GZIP).decompress(raw)
        kept = whole[: whole.rfind(b"\n") + 1]
        if not kept:
            raise
        lines = len(kept.splitlines())
        return kept, [f"the compressed file is cut off; read as far as line {lines}"]


def _text(raw: bytes, name: str) -> tuple[str, list[str]]:
    """The text of the bytes in an encoding that loggers and spreadsheets use, and a message if it is not UTF-8. Raises Unreadable."""
    if raw and not raw.strip(b"\0"):
        raise Unreadable(
            f"{name}: contains only zero bytes ({len(raw)}); was power lost while it was written?"
        )
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return raw.decode("utf-16"), []
    try:
        return raw.decode("utf-8-sig"), []
    except UnicodeDecodeError:
        if b"\0" in raw[:BEGINNING]:
            raise Unreadable(f"{name}: is not a text file; is it a recording of another kind?") from None
        # Windows-1252 decodes nearly every byte: a wrong guess only spoils the µ or ° of a heading
        return raw.decode("cp1252", "replace"), ["is not UTF-8; read as Windows-1252"]


def _are_units(row: Sequence[str], names: Sequence[str], decimal: str) -> bool:
    """Whether the row below a heading without units contains the units, as many exports have it."""
    texts = [cell.strip() for cell in row if cell.strip()]
    if not texts or any(heading(name)[1] is not None for name in names):
        return False
    try:
        for unit in texts:
            if unit not in TIME_UNITS:
                parse_scaled(unit)
    except ValueError:
        return False
    return not any(_is_number(unit, decimal) for unit in texts)


def _is_number(cell: str, decimal: str) -> bool:
    try:
        float(cell.strip().replace(decimal, "."))
    except ValueError:
        return False
    return True


def _constant(line: str) -> dict[str, tuple[float, str | None]]:
    """'# mass [kg] = 0.058' is a constant of the recording; other comments are not."""
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
    """Rows with their line numbers, and a message for each row of another width; before: lines read so far."""
    kept: list[tuple[int, list[str]]] = []
    skipped: list[str] = []
    for number, row in enumerate(reader, start=before + 1):
        if len(row) == width:
            kept.append((number, row))
        elif row:
            skipped.append(f"line {number} has {len(row)} of {width} cells")
    return kept, skipped


def _column(title: str, cells: Sequence[str], decimal: str, lines: Sequence[int]) -> _Raw:
    name, unit = heading(title)
    value, there = np.full(len(cells), np.nan), np.ones(len(cells), bool)
    damaged, first = 0, 0
    for i, cell in enumerate(cells):
        text = cell.strip().replace(decimal, ".") if decimal != "." else cell
        try:
            value[i] = float(text)
        except ValueError:
            there[i] = bool(text.strip())
            if there[i]:
                damaged += 1
                first = first or lines[i]
    damage = f"{damaged} of {value.size} cells are not numbers, the first in line {first}" if damaged else ""
    return _Raw(name, unit, value, there, damage)


def _clock(columns: Sequence[_Raw], name: str, time: tuple[str, str | None] | None) -> _Raw:
    """The time column, by its given or a usual name. Raises Unreadable."""
    if time is not None:
        given = [c for c in columns if c.name == time[0]]
        if not given:
            raise Unreadable(f"{name}: has no column {time[0]} for the time; the file has {named(columns)}")
        return replace(given[0], unit=time[1] or given[0].unit or _time_unit(given[0].name))
    for column in columns:
        if _is_time(column.name):
            return replace(column, unit=column.unit or _time_unit(column.name))
    raise Unreadable(
        f"{name}: no time column found; its heading must look like 'time [s]', 'time_s' or 't [ms]', or --channel time=COLUMN names it; "
        f"the file has {named(columns)}"
    )


def _is_time(name: str) -> bool:
    """Whether a heading is a usual one of the time: 'Time', 'time_ms', 'Time Stamp', 't (s)'."""
    words = WORDS.sub(" ", name).lower().split()
    if len(words) > 1 and words[-1] in TIME_UNITS:
        words = words[:-1]
    return " ".join(words) in TIME


def _time_unit(name: str) -> str | None:
    """The unit at the end of a heading: 'ms' of 'time_ms'; None without one."""
    words = WORDS.sub(" ", name).split()
    return words[-1] if len(words) > 1 and words[-1] in TIME_UNITS else None


def _stamps(clock: _Raw, name: str) -> Array:
    """Times [s] of every row. Raises Unreadable."""
    unit = clock.unit or "s"
    if unit not in TIME_UNITS:
        raise Unreadable(f"{name}: the unit of time is '{unit}'; known are {', '.join(TIME_UNITS)}")
    if clock.value.size == 0:
        raise Unreadable(f"{name}: has a heading but no rows")
    if np.isnan(clock.value).all():
        raise Unreadable(f"{name}: the column {clock.name} contains no numbers")
    return clock.value * TIME_UNITS[unit]


def named(columns: Sequence[Column | _Raw], most: int = 30) -> str:
    """'the columns a, b, c' for a message, at most `most` of them."""
    names = [c.name for c in columns]
    return f"the columns {', '.join(names[:most])}{' ...' if len(names) > most else ''}"
