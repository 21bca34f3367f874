"""Finds the channels of a model among the columns of a file and converts them to the model's units."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from diagnosis.reading.tables import Column, Table
from discrepancy.model.description import Model
from discrepancy.signals.recording import Array, Complaint, Recording, Signal
from discrepancy.signals.units import parse_scaled, parse_unit

SHOWN = 8  # messages about damaged lines, per file
LARGEST = 1e30  # in any unit: no measured quantity is so large, while random bytes read as floats often are


def to_recording(
    table: Table,
    name: str,
    model: Model,
    renamed: Mapping[str, str],
    units: Mapping[str, str] | None = None,
) -> tuple[Recording, list[Complaint]]:
    """The model's channels among the columns of a table, in the model's units, and complaints about them.

    renamed: channel -> column, or several columns by comma, which are averaged; units: channel -> unit instead of that in the heading.
    """
    complaints = [Complaint(name, "", text) for text in table.skipped[:SHOWN]]
    if len(table.skipped) > SHOWN:
        complaints.append(Complaint(name, "", f"{len(table.skipped)} damaged lines in all; skipped"))
    names = [c.name for c in table.columns]
    by_name = {c.name: c for c in table.columns}
    signals: dict[str, Signal] = {}
    for channel, unit in {**model.driving, **model.outputs}.items():
        wanted = renamed.get(channel, model.columns.get(channel, channel)).split(",")
        columns = [by_name[w.strip()] for w in wanted if w.strip() in by_name]
        if len(columns) < len(wanted):
            continue
        # no guess: the first of two equal headings may be the wrong one
        if repeated := [c.name for c in columns if names.count(c.name) > 1]:
            text = f"{names.count(repeated[0])} columns are called {repeated[0]}; rename all but one of them"
            complaints.append(Complaint(name, channel, text, fatal=True))
            continue
        if units and channel in units:
            columns = [replace(c, unit=units[channel]) for c in columns]
        parts, said = _parts(columns, channel, unit, name, held=channel in model.held)
        complaints += said
        if parts:
            signals[channel] = _mean(parts)
    constants, said = _constants(table, name, model)
    return Recording(name, signals, constants), complaints + said


def unknown_columns(columns: Sequence[Column], renamed: Mapping[str, str]) -> list[str]:
    """Columns named by --channel that the files of a run do not have."""
    there = {c.name for c in columns}
    wanted = [part.strip() for column in renamed.values() for part in column.split(",")]
    return [column for column in wanted if column not in there]


def _parts(
    columns: Sequence[Column], channel: str, unit: str, name: str, *, held: bool
) -> tuple[list[Signal], list[Complaint]]:
    parts, complaints = [], []
    for column in columns:
        column, wild = _measurable(column, channel, name)
        values, own_unit, said = _converted(column, channel, unit, name)
        complaints += wild
        complaints += said
        if any(c.fatal for c in said):
            return [], complaints
        parts.append(Signal(column.time_s, values, own_unit, held))
    return parts, complaints


def _measurable(column: Column, channel: str, name: str) -> tuple[Column, list[Complaint]]:
    """The column with impossibly large values as NaN (damage), and a complaint about them."""
    wild = np.abs(column.value) > LARGEST
    if not wild.any():
        return column, []
    text = f"{np.count_nonzero(wild)} of {wild.size} values are larger than {LARGEST:g}, probably damaged bytes read as numbers; dropped"
    return replace(column, value=np.where(wild, np.nan, column.value)), [Complaint(name, channel, text)]


def _mean(parts: Sequence[Signal]) -> Signal:
    """The average at the stamps of the first column; the others are interpolated linearly."""
    if len(parts) == 1:
        return parts[0]
    first = parts[0]
    values: Array = np.mean([np.interp(first.time_s, p.time_s, p.value) for p in parts], axis=0)
    return Signal(first.time_s, values, first.unit, first.held)


def _converted(column: Column, channel: str, unit: str, name: str) -> tuple[Array, str, list[Complaint]]:
    complaints = [Complaint(name, channel, column.damage)] if column.damage else []
    if column.unit is None:
        complaints.append(Complaint(name, channel, f"has no unit in its heading; {unit} is assumed"))
        return column.value, unit, complaints
    try:
        scaled = parse_scaled(column.unit, unit)
    except ValueError as error:
        complaints.append(Complaint(name, channel, str(error), fatal=True))
        return column.value, unit, complaints
    # Another quantity keeps its own unit; the engine's check of units then rejects it and names both units.
    if not scaled.unit.same_quantity(parse_unit(unit)):
        return column.value, str(scaled.unit), complaints
    return column.value * scaled.factor + scaled.offset, unit, complaints


def _constants(table: Table, name: str, model: Model) -> tuple[dict[str, float], list[Complaint]]:
    constants, complaints = {}, []
    for key, (value, unit) in table.constants.items():
        try:
            constants[key] = constant(model, key, value, unit)
        except ValueError as error:
            complaints.append(Complaint(name, key, str(error), fatal=True))
    return constants, complaints


def constant(model: Model, name: str, value: float, unit: str | None) -> float:
    """A constant of a recording in the model's unit. Raises ValueError for another quantity."""
    needed = model.constants.get(name)
    if needed is None or unit is None:
        return value
    scaled = parse_scaled(unit, needed)
    if not scaled.unit.same_quantity(parse_unit(needed)):
        raise ValueError(f"is in {unit}, the model needs {needed}")
    return value * scaled.factor + scaled.offset
