"""Reads raw recordings as columns in SI at the time stamps of the file: CSV, Parquet, MATLAB .mat, and CAN frames with a DBC file.

Tables and CAN logs are read as by `loaderhil diagnose`. A missing sample is NaN, so that a gap keeps its place.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bus.user_error import UserError
from diagnosis.reading.can import decoder, read_can
from diagnosis.reading.tables import TIME, Column, Unreadable, is_table, read_table
from discrepancy.signals.units import parse_scaled, parse_unit
from identify import matlab

Array = NDArray[np.float64]


class BadRecording(UserError, ValueError):
    """A recording or its description cannot be used; the message names file, channel, unit and likely cause."""


def read_channels(
    path: Path,
    channels: Mapping[str, str],
    units: Mapping[str, str],
    *,
    given: Mapping[str, str] | None = None,
    dbcs: Sequence[Path] = (),
) -> tuple[Array, dict[str, Array]]:
    """Stamps (n,) [s] and channels (n,) in SI, NaN where a channel has no sample.

    channels: column of each channel; units: the SI unit of each; given: units of columns whose headings have none.
    Raises BadRecording.
    """
    columns = {c.name: c for c in _columns(path, dbcs)}
    found: dict[str, Column] = {}
    for name, column in channels.items():
        if column not in columns:
            raise BadRecording(f"{path}: has no column '{column}' for {name}; it has {', '.join(columns)}")
        found[name] = columns[column]
    time = _common(found)
    out = {}
    for name, c in found.items():
        value = np.full(time.size, np.nan)
        value[_rows(path, time, c)] = c.value * _factor(path, name, c, units[name], given or {})
        out[name] = value
    return time, out


def _common(found: Mapping[str, Column]) -> Array:
    """Stamps of all rows: the union of those of the channels where they ascend, else those of the channel that has most."""
    if all(bool(np.all(np.diff(c.time_s) > 0.0)) for c in found.values()):
        return np.unique(np.concatenate([c.time_s for c in found.values()]))
    return max((c.time_s for c in found.values()), key=lambda t: t.size)


def _rows(path: Path, time: Array, column: Column) -> NDArray[np.intp]:
    """Row of each sample of a column. Stamps may repeat, so they are matched in their order and not by value."""
    if column.time_s.size == time.size:
        return np.arange(time.size)
    if bool(np.all(np.diff(time) > 0.0)):
        return np.searchsorted(time, column.time_s)
    rows, at, stamps = np.empty(column.time_s.size, np.intp), 0, time.tolist()
    for i, stamp in enumerate(column.time_s.tolist()):
        while at < len(stamps) and stamps[at] != stamp:
            at += 1
        if at == len(stamps):
            raise BadRecording(
                f"{path}: stamps repeat or go back, and no channel is complete: rows of '{column.name}' cannot be assigned; "
                "write 'nan' into empty cells"
            )
        rows[i] = at
        at += 1
    return rows


def _factor(path: Path, name: str, column: Column, wanted: str, given: Mapping[str, str]) -> float:
    unit = column.unit if column.unit is not None else given.get(name)
    if unit is None:
        raise BadRecording(
            f"{path}: column '{column.name}' has no unit; write it into the heading ('{column.name} [{wanted}]') or under [units]"
        )
    try:
        scaled = parse_scaled(unit, wanted)
    except ValueError as error:
        raise BadRecording(f"{path}: column '{column.name}': {error}") from error
    if not scaled.unit.same_quantity(parse_unit(wanted)):
        raise BadRecording(
            f"{path}: column '{column.name}' is in {unit}, but {name} needs {wanted}: is it another column?"
        )
    return float(scaled.factor)


def _columns(path: Path, dbcs: Sequence[Path]) -> Sequence[Column]:
    if not path.exists():
        raise BadRecording(f"{path}: no such file")
    try:
        if path.suffix.lower() == ".mat":
            return _mat(path)
        if is_table(path):
            return read_table(path).columns
        if not dbcs:
            raise BadRecording(
                f"{path}: is not a table (.csv, .csv.gz, .parquet, .mat); a recording of CAN frames needs --dbc FILE"
            )
        return read_can(path, decoder(dbcs)).columns
    except Unreadable as error:
        raise BadRecording(f"{path.parent}/{error}") from error


def _mat(path: Path) -> list[Column]:
    """Vectors of a MATLAB file, version 7 or older; names carry no units."""
    try:
        vectors = matlab.vectors(path)
    except matlab.Newer as error:
        raise BadRecording(f"{path}: is a file of MATLAB 7.3 (HDF5); save it with '-v7'") from error
    except matlab.Damaged as error:
        raise BadRecording(f"{path}: cannot be read as a MATLAB file: {error}") from error
    except OSError as error:
        raise BadRecording(f"{path}: {error.strerror}") from error
    time = next((vectors.pop(name) for name in list(vectors) if name.lower() in TIME), None)
    if time is None:
        raise BadRecording(
            f"{path}: has no time vector ({', '.join(TIME)}); it has {', '.join(vectors) or 'no vectors'}"
        )
    odd = [name for name, v in vectors.items() if v.size != time.size]
    if odd:
        raise BadRecording(
            f"{path}: '{odd[0]}' has {vectors[odd[0]].size} values and time has {time.size}: each system belongs into a file of its own"
        )
    return [Column(name, None, time, v) for name, v in vectors.items()]
