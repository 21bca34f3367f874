"""Reads tables: CSV or Parquet with one column per channel, headed `name [unit]`, and one column of time.

An Unreadable is raised only where no column can be trusted. An empty cell means that there is no sample; a cell that is not a number counts
as damage.
"""

import codecs
import csv
import io
import math
import re
import zlib
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
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
TEXT_FREE = 64 << 20
"""Bytes of text that a compressed table may have in any case."""
TEXT_LIMIT = 25
"""How many times longer than its file a compressed table may be; logged numbers come to 3 to 15, gzip's most is 1032."""
SKIPPED_SHOWN = 100
"""Rows of another width that get a sentence each."""
LINE_END = b"\n"
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
        raw, cut = unpacked(raw, path.name)
    encoding, doubtful = _encoding(raw, path.name)
    # Decoded as it is read: io.StringIO would take four bytes per character.
    lines = io.TextIOWrapper(io.BytesIO(raw), encoding, errors="replace", newline="")
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
    rows, skipped = _Rows(csv.reader(lines, delimiter=separator), len(names), number), _Skipped()
    cells = [_Cells() for _ in names]
    first = next(rows.kept(skipped), None)
    if first is not None and _are_units(first[1], names, decimal):
        names = [
            f"{name} [{unit.strip()}]" if unit.strip() else name
            for name, unit in zip(names, first[1], strict=True)
        ]
        first = None
    for line_number, row in chain([first] if first is not None else [], rows.kept(skipped)):
        for column, cell in zip(cells, row, strict=True):
            column.add(cell, decimal, line_number)
    columns = [column.raw(name) for name, column in zip(names, cells, strict=True) if name.strip()]
    return columns, constants, [*cut, *doubtful, *skipped.sentences()]


def unpacked(raw: bytes, name: str) -> tuple[bytes, list[str]]:
    """The content of a gzip file; of one that is cut off, up to its last complete line.

    Raises OSError or zlib.error for other damage, Unreadable for one that unpacks to more than any recording.
    """
    limit = max(TEXT_FREE, TEXT_LIMIT * len(raw))
    text, rest = bytearray(), raw
    while rest.strip(b"\0") or not text:  # gzip pads with zero bytes, and a file may have several members
        member = zlib.decompressobj(GZIP)
        text += member.decompress(rest, limit + 1 - len(text))
        if len(text) > limit:
            raise Unreadable(
                f"{name}: {len(raw)} compressed bytes hold more than {limit >> 20} MiB of text, which no recording does; "
                "unpack it first if it is one"
            )
        if not member.eof:
            kept = bytes(text[: text.rfind(b"\n") + 1])
            if not kept:
                raise EOFError("Compressed file ended before the end-of-stream marker was reached")
            return kept, [f"the compressed file is cut off; read as far as line {kept.count(LINE_END)}"]
        rest = member.unused_data
    return bytes(text), []


def _encoding(raw: bytes, name: str) -> tuple[str, list[str]]:
    """An encoding of the bytes that loggers and spreadsheets use, and a message if it is not UTF-8. Raises Unreadable."""
    if raw and not raw.strip(b"\0"):
        raise Unreadable(
            f"{name}: contains only zero bytes ({len(raw)}); was power lost while it was written?"
        )
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raw.decode("utf-16")
        return "utf-16", []
    try:
        raw.decode("utf-8-sig")
        return "utf-8-sig", []
    except UnicodeDecodeError:
        if b"\0" in raw[:BEGINNING]:
            raise Unreadable(f"{name}: is not a text file; is it a recording of another kind?") from None
        # Windows-1252 decodes nearly every byte: a wrong guess only spoils the µ or ° of a heading
        return "cp1252", ["is not UTF-8; read as Windows-1252"]


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


class _Skipped:
    """Rows that were left out: the first with a sentence each, all of them counted."""

    def __init__(self) -> None:
        self._first: list[str] = []
        self._count = 0

    def add(self, sentence: str) -> None:
        self._count += 1
        if self._count <= SKIPPED_SHOWN:
            self._first.append(sentence)

    def sentences(self) -> list[str]:
        more = self._count - len(self._first)
        return [*self._first, *([f"{more} more lines have another number of cells"] if more else [])]


class _Rows:
    """Rows of the right width with their line numbers."""

    def __init__(self, reader: Iterator[list[str]], width: int, before: int) -> None:
        """before: lines read so far."""
        self._numbered = enumerate(reader, start=before + 1)
        self._width = width

    def kept(self, skipped: _Skipped) -> Iterator[tuple[int, list[str]]]:
        """Go on from where the last call ended; a row of another width goes to `skipped`."""
        for number, row in self._numbered:
            if len(row) == self._width:
                yield number, row
            elif row:
                skipped.add(f"line {number} has {len(row)} of {self._width} cells")


class _Cells:
    """One column while it is read: nine bytes per cell, however long its text was."""

    def __init__(self) -> None:
        self._value = array("d")
        self._there = bytearray()
        self._damaged = self._first = 0

    def add(self, cell: str, decimal: str, line: int) -> None:
        """The cell of the next row."""
        text = cell.strip().replace(decimal, ".") if decimal != "." else cell
        try:
            value, there = float(text), True
        except ValueError:
            value, there = math.nan, bool(text.strip())
            self._damaged += there
            self._first = self._first or (line if there else 0)
        self._value.append(value)
        self._there.append(there)

    def raw(self, title: str) -> _Raw:
        """The column under its heading."""
        name, unit = heading(title)
        value = np.frombuffer(self._value, float) if self._value else np.empty(0)
        there = np.frombuffer(self._there, bool) if self._there else np.empty(0, bool)
        damage = ""
        if self._damaged:
            damage = f"{self._damaged} of {value.size} cells are not numbers, the first in line {self._first}"
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
