"""The run directory: what one run leaves behind, written by lockstep and by the processes alike.

    run.json        what was run, in which mode, and how it ended (RunRecord)
    truth.npz       the plant's own state, one array per field, first axis time, 100 Hz
    bus.log         every frame between plant and ECU, candump -L format
    reference.log   the frames of the test instrumentation, which the ECU never sees (optional)
    timing.npz      per tick of a real-time run: lateness, execution, reaction [ns] (optional)

A killed run leaves a directory that still reads: what is missing or cut off is listed in
`problems`, everything else is there.
"""

import contextlib
import json
import os
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from dbc.columns import ColumnDecoder, Columns
from dbc.database import Database
from dbc.logfile import read_candump
from numpy.typing import NDArray
from pydantic import ConfigDict, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass as checked_dataclass

from dbc import loader_database, reference_database

RECORD, TRUTH, BUS, REFERENCE, TIMING = "run.json", "truth.npz", "bus.log", "reference.log", "timing.npz"
FILES = (RECORD, TRUTH, BUS, REFERENCE, TIMING)

Mode = Literal["lockstep", "realtime"]
Outcome = Literal["running", "finished", "interrupted", "failed"]


class RunError(ValueError):
    """A run directory cannot be read or written; the message names the file and the cause."""


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=ConfigDict(extra="forbid", strict=True))
class RunRecord:
    """The content of run.json.

    epoch_ns: stamp of the bus clock at truth time zero; None until the plant has started.
    duration_s: simulated time that was recorded. outcome "running" in a file that nobody
    writes any more means that the run was killed.
    """

    scenario: str
    machine: str
    mode: Mode
    form: str
    limits: bool
    seed: int
    payload_kg: float
    started: str
    epoch_ns: int | None = None
    duration_s: float = 0.0
    outcome: Outcome = "running"
    reason: str = ""
    versions: dict[str, str] = field(default_factory=dict)
    statistics: dict[str, float | int | str] = field(default_factory=dict)


_record = TypeAdapter(RunRecord)


class Table(Mapping[str, NDArray[Any]]):
    """Named arrays of one file; a missing name is an error that says what there is."""

    def __init__(self, source: Path, columns: Mapping[str, NDArray[Any]]) -> None:
        self.source = source
        self._columns = dict(columns)

    def __getitem__(self, name: str) -> NDArray[Any]:
        try:
            return self._columns[name]
        except KeyError:
            raise RunError(f"{self.source}: no column '{name}'; it has {', '.join(self._columns)}") from None

    def __contains__(self, name: object) -> bool:
        return name in self._columns

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunDirectory:
    """A run as read back.

    truth: columns of truth.npz named as the fields of the plant's truth; empty when the file is missing.
    messages, reference: decoded frames by message name, times [s] on the clock of truth["time_s"].
    timing: columns of timing.npz [ns]; empty for lockstep runs.
    problems: what is missing or damaged, one sentence each.
    """

    path: Path
    record: RunRecord
    truth: Table
    messages: dict[str, Columns]
    reference: dict[str, Columns]
    timing: Table
    problems: tuple[str, ...]

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """Read whatever is there; only a missing or wrong run.json is an error."""
        path = Path(path)
        record = read_record(path)
        problems: list[str] = []
        if record.outcome == "running":
            problems.append(f"{path / RECORD}: the run was killed before it ended, or is still running")
        epoch_s = None if record.epoch_ns is None else record.epoch_ns * 1e-9
        truth = _read_table(path / TRUTH, problems, optional=False)
        messages = _read_log(path / BUS, loader_database(), epoch_s, problems, optional=False)
        reference = _read_log(path / REFERENCE, reference_database(), epoch_s, problems, optional=True)
        timing = _read_table(path / TIMING, problems, optional=record.mode == "lockstep")
        return cls(
            path=path,
            record=record,
            truth=truth,
            messages=messages,
            reference=reference,
            timing=timing,
            problems=tuple(problems),
        )


def read_record(path: Path) -> RunRecord:
    """run.json of the run directory `path`."""
    file = path / RECORD
    if not path.is_dir():
        raise RunError(f"{path}: no such run directory; `loaderhil run SCENARIO --out {path}` writes one")
    try:
        return _record.validate_json(file.read_bytes())
    except FileNotFoundError:
        raise RunError(f"{path}: not a run directory, it has no {RECORD}") from None
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"]) or "file"
        raise RunError(f"{file}: {key}: {first['msg']}, got {_short(first['input'])}") from None


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def begin(path: Path, record: RunRecord) -> None:
    """Make `path` an empty run directory with the record of a run that is starting.

    The files of an earlier run in the same place are removed; a folder that holds
    anything else is refused.
    """
    if path.exists() and not path.is_dir():
        raise RunError(f"{path}: is a file, not a folder")
    if path.is_dir() and not (path / RECORD).exists() and any(path.iterdir()):
        raise RunError(f"{path}: is not empty and holds no earlier run; name a new folder")
    path.mkdir(parents=True, exist_ok=True)
    for name in FILES:
        (path / name).unlink(missing_ok=True)
    write_record(path, record)


def write_record(path: Path, record: RunRecord) -> None:
    """Replace run.json in one step: a reader sees the old or the new one, never half."""
    text = json.dumps(asdict(record), indent=2, ensure_ascii=False) + "\n"
    with _replacing(path / RECORD) as part:
        part.write_text(text, encoding="utf-8")


def write_table(file: Path, columns: Mapping[str, NDArray[Any]]) -> None:
    """Write named arrays to `file` (.npz) in one step."""
    with _replacing(file) as part, part.open("wb") as stream:
        np.savez(stream, **dict(columns))  # type: ignore[arg-type]  # names are columns, not options


def write_truth(path: Path, rows: Sequence[Any]) -> None:
    """Write truth.npz from one record of the plant's truth per tick (dataclasses of floats or sequences)."""
    names = list(rows[0].__dataclass_fields__) if rows else ["time_s"]
    write_table(path / TRUTH, {name: np.array([getattr(row, name) for row in rows], float) for name in names})


def ended(record: RunRecord, outcome: Outcome, **changes: Any) -> RunRecord:
    """The record of a run that is over."""
    return replace(record, outcome=outcome, **changes)


@contextlib.contextmanager
def _replacing(file: Path) -> Iterator[Path]:
    part = file.with_name(f".{file.name}.{os.getpid()}")
    try:
        yield part
        part.replace(file)
    finally:
        part.unlink(missing_ok=True)


def _read_table(file: Path, problems: list[str], *, optional: bool) -> Table:
    try:
        with np.load(file, allow_pickle=False) as archive:
            return Table(file, {name: archive[name] for name in archive.files})
    except FileNotFoundError:
        if not optional:
            problems.append(f"{file}: missing; its writer was killed before the run ended")
    except (ValueError, OSError, EOFError, zipfile.BadZipFile) as error:
        problems.append(f"{file}: unreadable ({error}); was it cut off while being copied?")
    return Table(file, {})


def _read_log(
    file: Path, database: Database, epoch_s: float | None, problems: list[str], *, optional: bool
) -> dict[str, Columns]:
    if not file.exists():
        if not optional:
            problems.append(f"{file}: missing; the run was killed before the first frame was written")
        return {}
    table = read_candump(file)
    problems.extend(f"{file}: {damage}" for damage in table.damaged)
    columns = ColumnDecoder(database).decode(table)
    if epoch_s is None:
        epoch_s = min((float(c.time_s[0]) for c in columns.values() if c.time_s.size), default=0.0)
    return {name: replace(c, time_s=c.time_s - epoch_s) for name, c in columns.items()}
