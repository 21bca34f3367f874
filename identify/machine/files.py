"""Weighings as a table: one row each, headings with units ('articulation [deg]', 'front_left [kN]')."""

import csv
from pathlib import Path

import numpy as np

from diagnosis.reading.tables import heading
from discrepancy.signals.units import parse_scaled, parse_unit
from identify.machine.weighing import Weighing
from identify.reading import BadRecording

ANGLES = ("articulation", "grade", "bank")
LOADS = ("front_left", "front_right", "rear_left", "rear_right")


def read_weighings(path: Path) -> list[Weighing]:
    """All rows of a CSV file; grade and bank may be missing, which is level ground. Raises BadRecording."""
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            rows = [row for row in csv.reader(stream) if row and not row[0].startswith("#")]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise BadRecording(f"{path}: cannot be read: {error}") from error
    if len(rows) < 2:
        raise BadRecording(
            f"{path}: has no weighings; a heading like 'articulation [deg],front_left [N],...' and rows are needed"
        )
    columns: dict[str, tuple[int, float]] = {}
    for at, text in enumerate(rows[0]):
        name, unit = heading(text)
        if name not in (*ANGLES, *LOADS):
            raise BadRecording(f"{path}: column '{text}' is none of {', '.join((*ANGLES, *LOADS))}")
        wanted = "rad" if name in ANGLES else "N"
        try:
            scaled = parse_scaled(unit or "", wanted)
        except ValueError as error:
            raise BadRecording(f"{path}: column '{text}': {error}") from error
        if unit is None or not scaled.unit.same_quantity(parse_unit(wanted)):
            raise BadRecording(f"{path}: column '{text}' needs a unit of {wanted}")
        columns[name] = (at, float(scaled.factor))
    if missing := [name for name in ("articulation", *LOADS) if name not in columns]:
        raise BadRecording(f"{path}: has no column {', '.join(missing)}")
    return [_weighing(path, number, row, columns) for number, row in enumerate(rows[1:], 2)]


def _weighing(path: Path, number: int, row: list[str], columns: dict[str, tuple[int, float]]) -> Weighing:
    try:
        value = {name: float(row[at]) * factor for name, (at, factor) in columns.items()}
    except (ValueError, IndexError) as error:
        # repr: a quoted cell may hold line ends
        raise BadRecording(
            f"{path}:{number}: a cell is no number or missing: {','.join(row)[:80]!r}"
        ) from error
    return Weighing(
        loads=np.array([value[n] for n in LOADS]),
        articulation=value["articulation"],
        grade=value.get("grade", 0.0),
        bank=value.get("bank", 0.0),
    )
