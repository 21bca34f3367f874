"""Reads and writes the run directory: the files of one run, in lockstep or as processes.

    run.json        what was run, in which mode, and how it ended (RunRecord)
    truth.npz       the plant's own state, one array per field, first axis time, 100 Hz
    truth.rows      the same while a real-time run goes on, row by row; left by a run that was killed (optional)
    bus.log         every frame between plant and ECU, candump -L format; with a gateway, those of the plant's bus
    ecu-bus.log     with a gateway, the frames of the ECU's bus (optional)
    reference.log   the frames of the test instrumentation, which the ECU never sees (optional)
    timing.npz      per tick of a real-time run: lateness, execution, due time; per reaction: its way; waits for a processor
                    of each process, see hil.timing.waits [ns] (optional)
    latency.hlog    histograms of the hops of that way, HdrHistogram log format (optional)
    ecu.log, plant.log, gateway.log   findings of the processes of a real-time run, one line each (optional)
    .room           takes up space while a run goes on, so that a full disk has room for the last run.json (optional)
    faults.json     injected faults: when each began and ended, and how many frames it affected (optional)

The directory of a killed run is still readable: missing and cut-off files are listed in
`problems`, all others are read.
"""

import contextlib
import os
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass as checked_dataclass

from bus.user_error import UserError
from dbc import loader_database, reference_database
from dbc.database import Database
from hil.timing.punctuality import Punctuality
from hil.timing.vitals import Vitals
from hil.verdict import Verdict

if TYPE_CHECKING:
    from dbc.columns import Columns

RECORD, TRUTH, BUS, REFERENCE, TIMING = "run.json", "truth.npz", "bus.log", "reference.log", "timing.npz"
TRUTH_ROWS = "truth.rows"
ROOM = ".room"
"""A file that only takes up space while a run goes on, and makes room for its record when the disk is full."""
ROOM_BYTES = 1 << 16
ECU_BUS, LATENCY = "ecu-bus.log", "latency.hlog"
ECU_LOG, PLANT_LOG, GATEWAY_LOG = "ecu.log", "plant.log", "gateway.log"
FAULTS = "faults.json"
FILES = (
    RECORD,
    TRUTH,
    TRUTH_ROWS,
    BUS,
    ECU_BUS,
    REFERENCE,
    TIMING,
    LATENCY,
    ECU_LOG,
    PLANT_LOG,
    GATEWAY_LOG,
    FAULTS,
    ROOM,
)

FOREIGN_ZERO = "attend_zero_ns"
"""Among the statistics of a run against a foreign machine: the stamp of its time zero."""

Mode = Literal["lockstep", "realtime"]
Outcome = Literal["running", "finished", "interrupted", "failed"]
Clock = Callable[[NDArray[np.float64], float], NDArray[np.float64]]
"""Stamps of a log and its first stamp [s] to times of the run [s]."""


class RunError(UserError, ValueError):
    """A run directory cannot be read or written; the message names the file and the cause."""


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=ConfigDict(extra="forbid", strict=True))
class RunRecord:
    """The content of run.json. The names of the fields are the keys of the file."""

    scenario: str
    machine: str
    mode: Mode
    form: str  # equations of the ECU's estimators
    limits: bool  # whether the ECU limited the machine
    seed: int
    payload_kg: float
    started: str  # ISO 8601, UTC
    changes: tuple[str, ...] = ()  # KEY=VALUE, override the files
    duration_s: float = 0.0  # simulated time that was recorded [s]
    outcome: Outcome = "running"  # "running" after the run's end means that it was killed
    reason: str = ""  # why it did not finish
    calibration: str = "l60"
    ecu_core: str = "python"  # what computed the ECU; older runs had no other
    detect_faults: bool = False  # whether the ECU tested its sensors against each other; older runs did not
    versions: dict[str, str] = field(default_factory=dict)  # of packages
    # counters of the processes, PROCESS_COUNTER
    statistics: dict[str, float | int | str] = field(default_factory=dict)
    punctuality: Punctuality | None = None  # of a real-time run that ended
    vitals: Vitals | None = None  # of a real-time run that ended
    expectations: tuple[Verdict, ...] = ()  # on the [[expect]] tables
    foreign: dict[str, str] = field(default_factory=dict)  # side -> bus of a node that replaced ours
    standing_load_n: tuple[float, float, float, float] | None = (
        None  # straight on level ground; None in older runs
    )


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
    """A run as read from its directory."""

    path: Path
    record: RunRecord
    truth: Table  # columns named as the fields of the plant's truth, SI; empty when the file is missing
    messages: "dict[str, Columns]"  # decoded frames by message, times [s] on the clock of truth["time_s"]
    reference: "dict[str, Columns]"  # the same of the test instrumentation
    timing: Table  # columns of timing.npz [ns]; empty for a lockstep run
    problems: tuple[str, ...]  # missing and damaged files, one sentence each

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """Read all files that exist; only a missing or invalid run.json is an error."""
        path = Path(path)
        record = read_record(path)
        problems: list[str] = []
        if record.outcome == "running":
            problems.append(f"{path / RECORD}: the run was killed before it ended, or is still running")
        truth = _read_truth(path, problems, optional="plant" in record.foreign)
        timing = _read_table(path / TIMING, problems, optional=record.mode == "lockstep")
        clock = _run_clock(record, truth, timing)
        messages = _read_log(path / BUS, loader_database(), clock, problems, optional=False)
        reference = _read_log(path / REFERENCE, reference_database(), clock, problems, optional=True)
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
    if path.is_file():
        raise RunError(f"{path}: is a file; a run is named by its folder")
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


def refuse_if_foreign(path: Path) -> None:
    """Refuse a path that is a file, or a folder with other files than those of an earlier run."""
    if path.exists() and not path.is_dir():
        raise RunError(f"{path}: is a file, not a folder")
    if path.is_dir() and not (path / RECORD).exists() and any(path.iterdir()):
        raise RunError(f"{path}: is not empty and holds no earlier run; name a new folder")


def begin(path: Path, record: RunRecord) -> None:
    """Make `path` an empty run directory with the record of a run that is starting.

    The files of an earlier run in the same place are removed; a folder that holds
    anything else is refused.
    """
    refuse_if_foreign(path)
    with writing(path):
        path.mkdir(parents=True, exist_ok=True)
        # only files of a run are removed: the user may have named a folder with other content
        for file in (*(path / name for name in FILES), *path.glob("timing.*.npz"), *path.glob("stamps.*")):
            file.unlink(missing_ok=True)
    write_record(path, record)
    # the record of the end replaces the first one, for which both have to lie on the disk for a moment
    with writing(path / ROOM), (path / ROOM).open("wb") as room:
        os.posix_fallocate(room.fileno(), 0, ROOM_BYTES)


@contextlib.contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn an OSError while `path` is written into a RunError that names it."""
    try:
        yield
    except OSError as error:
        raise RunError(f"{path}: cannot be written: {error.strerror or error}") from error


def write_record(path: Path, record: RunRecord) -> None:
    """Replace run.json in one step: a reader sees the old or the new one, never half."""
    text = _record.dump_json(record, indent=2).decode() + "\n"
    (path / ROOM).unlink(missing_ok=True)
    with writing(path / RECORD), _replacing(path / RECORD) as part:
        part.write_text(text, encoding="utf-8")


def write_table(file: Path, columns: Mapping[str, NDArray[Any]]) -> None:
    """Write named arrays to `file` (.npz) in one step."""
    with writing(file), _replacing(file) as part, part.open("wb") as stream:
        np.savez(stream, **dict(columns))  # type: ignore[arg-type]  # names are columns, not options


def part_of_timing(path: Path, process: str) -> Path:
    """The file in which a process writes its part of timing.npz."""
    return path / f"timing.{process}.npz"


def stamps(path: Path, process: str) -> Path:
    """The file in which a process writes the stamps of the frames that mark the path of a reaction."""
    return path / f"stamps.{process}"


def merge_timing(path: Path, processes: Sequence[str] = ("plant", "ecu", "way", "waits")) -> None:
    """Merge the parts that the processes wrote into one timing.npz, with columns PROCESS_COLUMN."""
    merged: dict[str, NDArray[Any]] = {}
    for process in processes:
        part = part_of_timing(path, process)
        if part.exists():
            with np.load(part, allow_pickle=False) as archive:
                merged |= {f"{process}_{name}": archive[name] for name in archive.files}
            part.unlink()
    if merged:
        write_table(path / TIMING, merged)


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
        with file.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            return Table(file, {name: _numbers(archive, name) for name in archive.files})
    except FileNotFoundError:
        if not optional:
            problems.append(f"{file}: missing; its writer was killed before the run ended")
    # a damaged archive: wrong compression (RuntimeError, zlib.error), header (SyntaxError), or size (MemoryError)
    except (
        *(ValueError, OSError, EOFError, RuntimeError, KeyError, SyntaxError, MemoryError),
        *(zipfile.BadZipFile, zlib.error),
    ) as error:
        problems.append(f"{file}: unreadable ({error}); was it cut off while being copied?")
    return Table(file, {})


def _numbers(archive: Mapping[str, Any], name: str) -> NDArray[Any]:
    """A column of a table. ValueError if the archive holds something else there."""
    column = archive[name]
    # NumPy returns bytes where the header of an array is damaged
    if not isinstance(column, np.ndarray) or column.dtype.kind not in "biuf":
        raise ValueError(f"'{name}' holds no numbers")
    return column


def _read_truth(path: Path, problems: list[str], *, optional: bool) -> Table:
    """truth.npz, or the rows that a killed run left of it; optional: the machine was a foreign one."""
    if (path / TRUTH).exists() or not (path / TRUTH_ROWS).exists():
        return _read_table(path / TRUTH, problems, optional=optional)
    from plant.recorder import read_rows

    try:
        columns = read_rows(path / TRUTH_ROWS)
    except (OSError, ValueError) as error:
        problems.append(f"{path / TRUTH_ROWS}: unreadable ({error})")
        return Table(path / TRUTH, {})
    problems.append(
        f"{path / TRUTH}: missing; the plant was killed, and its rows up to then are read instead"
    )
    return Table(path / TRUTH_ROWS, columns)


def keep_truth(path: Path) -> None:
    """Make truth.npz of the rows that a killed plant left in the run directory `path`; otherwise do nothing."""
    if (path / TRUTH).exists() or not (path / TRUTH_ROWS).exists():
        return
    from plant.recorder import read_rows

    with contextlib.suppress(ValueError):  # killed before the first row
        # of a plant that found no room for it
        (path / f"{TRUTH}.partial").unlink(missing_ok=True)
        write_table(path / TRUTH, read_rows(path / TRUTH_ROWS))
        (path / TRUTH_ROWS).unlink()


def _run_clock(record: RunRecord, truth: Table, timing: Table) -> Clock:
    """From stamps of the bus [s] to the clock of the truth [s].

    In lockstep both are one clock. In real time the plant records the stamp at which each of its ticks was due. Against a
    foreign machine time zero is the begin of the run. Without any of these the first frame is time zero.
    """
    if record.mode == "lockstep":
        return lambda stamp_s, _: stamp_s
    if FOREIGN_ZERO in record.statistics:
        zero_s = int(record.statistics[FOREIGN_ZERO]) * 1e-9
        return lambda stamp_s, _: stamp_s - zero_s
    if "plant_due_ns" not in timing or "time_s" not in truth or not truth["time_s"].size:
        return lambda stamp_s, first_s: stamp_s - first_s
    count = min(truth["time_s"].size, timing["plant_due_ns"].size)
    # interpolated, not shifted: the plant's own clock stands still during a tick that it missed
    due_s, run_s = timing["plant_due_ns"][:count] * 1e-9, truth["time_s"][:count]
    beyond = np.array([1e6])  # before the first and after the last tick both clocks run alike
    known_s = np.concatenate((due_s[:1] - beyond, due_s, due_s[-1:] + beyond))
    known_run_s = np.concatenate((run_s[:1] - beyond, run_s, run_s[-1:] + beyond))
    return lambda stamp_s, _: np.interp(stamp_s, known_s, known_run_s)


def _read_log(
    file: Path, database: Database, clock: Clock, problems: list[str], *, optional: bool
) -> "dict[str, Columns]":
    # loads numba, 60 MB, which a process that only writes a run does not need
    from dbc.columns import ColumnDecoder
    from dbc.recordings.logfile import read_candump

    if not file.exists():
        if not optional:
            problems.append(f"{file}: missing; the run was killed before the first frame was written")
        return {}
    table = read_candump(file)
    problems.extend(f"{file}: {damage}" for damage in table.damaged)
    if (more := table.damaged_count - len(table.damaged)) > 0:
        problems.append(f"{file}: {more} more damaged lines")
    first_s = float(table.time_ns[0]) * 1e-9 if len(table.time_ns) else 0.0
    columns = ColumnDecoder(database).decode(table)
    return {name: replace(c, time_s=clock(c.time_s, first_s)) for name, c in columns.items()}
