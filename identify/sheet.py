"""A sheet of readings: a CSV file with one row per reading and units in its heading ('load [kN]', 'length [mm]')."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from diagnosis.reading.tables import heading
from discrepancy.signals.units import parse_scaled, parse_unit
from identify.reading import BadRecording

Array = NDArray[np.float64]


def read_sheet(path: Path, units: Mapping[str, str], required: Sequence[str], kind: str) -> dict[str, Array]:
    """Columns (n,) in SI by name, NaN where a cell is empty; lines that begin with # are skipped.

    units: of every column that a sheet may have, and that it is converted to; required: columns without which it is of no use, whose cells
    must not be empty; kind: what a row is, for messages. Raises BadRecording.
    """
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            reader = csv.reader(stream)
            rows = [(reader.line_num, row) for row in reader if row and row[0][:1] != "#"]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise BadRecording(f"{path}: cannot be read: {error}") from error
    if len(rows) < 2:
        example = ",".join(f"{name} [{units[name]}]" for name in required)
        raise BadRecording(f"{path}: has no {kind}; a heading like '{example},...' and rows are needed")
    columns = [_column(path, text, units) for text in rows[0][1]]
    names = [name for name, _ in columns]
    if missing := [name for name in required if name not in names]:
        raise BadRecording(f"{path}: has no column {', '.join(missing)}")
    if twice := [name for i, name in enumerate(names) if name in names[:i]]:
        raise BadRecording(f"{path}: has two columns {twice[0]}")
    value = np.full((len(rows) - 1, len(columns)), np.nan)
    for i, (number, row) in enumerate(rows[1:]):
        for j, (name, factor) in enumerate(columns):
            cell = row[j].strip() if j < len(row) else ""
            if not cell and name not in required:
                continue
            try:
                value[i, j] = float(cell) * factor
            except ValueError as error:
                # repr: a quoted cell may hold line ends
                raise BadRecording(
                    f"{path}:{number}: {name} is no number or missing: {','.join(row)[:80]!r}"
                ) from error
    return {name: value[:, j] for j, name in enumerate(names)}


def _column(path: Path, text: str, units: Mapping[str, str]) -> tuple[str, float]:
    """Name of a column and the factor to its unit."""
    name, unit = heading(text)
    if name not in units:
        raise BadRecording(f"{path}: column '{text}' is none of {', '.join(units)}")
    try:
        scaled = parse_scaled(unit or "", units[name])
    except ValueError as error:
        raise BadRecording(f"{path}: column '{text}': {error}") from error
    if unit is None or not scaled.unit.same_quantity(parse_unit(units[name])):
        raise BadRecording(f"{path}: column '{text}' needs a unit of {units[name]}")
    return name, float(scaled.factor)
