"""Reads all recordings of one diagnosis, of any kind. A recording that cannot be read becomes a complaint."""

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from bus.user_error import UserError
from dbc.columns import ColumnDecoder
from diagnosis.models import Choice, NoModel
from diagnosis.reading.can import decoder, read_can
from diagnosis.reading.channels import constant, to_recording, unknown_columns
from diagnosis.reading.computed import computed, is_formula, names_in
from diagnosis.reading.tables import Table, Unreadable, heading, is_table, named, read_table
from discrepancy.checks.clocks import join
from discrepancy.model.description import Clock, Model
from discrepancy.selection.state import Progress
from discrepancy.signals.recording import Complaint, Recording, Signal
from discrepancy.signals.units import parse_scaled


class Misuse(UserError, ValueError):
    """The options of the command line contradict each other or the model."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadOptions:
    """The recordings to read, and how."""

    paths: Sequence[Path]
    part: str | None = None  # of a published data set
    renamed: Mapping[str, str] = field(
        default_factory=dict
    )  # channel -> column, columns by comma, or formula
    units: Mapping[str, str] = field(default_factory=dict)  # channel -> unit in place of that of the heading
    time: tuple[str, str | None] | None = None  # column of time and its unit; None: by a usual name
    shifts: Mapping[str, float] = field(default_factory=dict)  # channel -> seconds added to its stamps
    constants: Mapping[str, tuple[float, str | None]] = field(
        default_factory=dict
    )  # name -> value and unit; None: the model's unit
    dbcs: Sequence[Path] = ()  # for recordings of CAN frames
    bus: str | None = None  # the only bus to read, of a log of several


@dataclass(frozen=True, slots=True)
class Read:
    """The recordings that could be read."""

    recordings: Sequence[Recording]
    complaints: Sequence[Complaint]  # errors of the files
    clocks: Sequence[Clock]  # offsets between the clocks of joined files
    machines: Mapping[str, str] = field(
        default_factory=dict
    )  # machine by recording, where run.json names one


def read_all(choice: Choice, options: ReadOptions, progress: Progress) -> Read:
    """Every run as a recording. A file that cannot be read becomes a complaint, so that the others are still judged.

    A path is a run, or several files of one run joined by '+'.
    """
    channels = choice.channels
    _check_names(channels, options)
    constants = constants_of(channels, options.constants)
    runs = _named(_different([_files(path) for path in options.paths]))
    through = decoder(options.dbcs)
    recordings: list[Recording] = []
    complaints: list[Complaint] = []
    clocks: list[Clock] = []
    machines: dict[str, str] = {}
    for name, files in runs.items():
        progress(f"reading {name}")
        try:
            joined = _run(files, name, choice, channels, options, through)
        except NoModel:  # the user's error (a missing --part, a fault in the model file), not the recording's
            raise
        except (OSError, EOFError, ValueError, KeyError) as error:
            complaints.append(Complaint(name, "", str(error).removeprefix(f"{name}: "), fatal=True))
            continue
        recordings += joined.recordings
        complaints += joined.complaints
        clocks += joined.clocks
        machines |= joined.machines
    return Read([_with_options(r, options, constants) for r in recordings], complaints, clocks, machines)


def _files(path: Path) -> list[Path]:
    """The files of a run. Raises Misuse for a missing one."""
    # a file whose own name has a '+' comes first
    files = [path] if path.exists() else [Path(part) for part in str(path).split("+")]
    for file in files:
        if not file.exists():
            raise Misuse(f"{file}: no such file or folder")
    return files


def _run(
    files: Sequence[Path],
    name: str,
    choice: Choice,
    channels: Model,
    options: ReadOptions,
    through: ColumnDecoder,
) -> Read:
    native = choice.native(files[0], options.part) if len(files) == 1 else None
    if native is not None:
        machines = {name: native.machine} if native.machine is not None else {}
        return Read(native.recordings, native.complaints, (), machines)
    tables, complaints = _tables(files, name, choice, options, through)
    known = [c for table in tables.values() for c in table.columns]
    formulas = [text for text in options.renamed.values() if is_formula(text, known)]
    tables = {file: _with_computed(table, formulas) for file, table in tables.items()}
    columns = [c for table in tables.values() for c in table.columns]
    if unknown := unknown_columns(columns, options.renamed):
        near = difflib.get_close_matches(unknown[0], [c.name for c in columns], n=1)
        hint = f" (did you mean {near[0]!r}?)" if near else ""
        raise Unreadable(f"{name}: has no column {', '.join(unknown)}{hint}; it has {named(columns)}")
    parts = []
    for file, table in tables.items():
        part, said = to_recording(table, file, channels, options.renamed, options.units)
        parts.append(part)
        complaints += said
    joined = join(channels, parts, name)
    if not any(channel in joined.recording.signals for channel in channels.outputs):
        text = f"has none of the model's outputs; it has {named(columns)}; --channel NAME=COLUMN assigns them"
        complaints.append(Complaint(name, "", text))
    complaints += _dead_inputs(joined.recording, channels)
    return Read([joined.recording], [*joined.complaints, *complaints], joined.clocks)


def _tables(
    files: Sequence[Path], name: str, choice: Choice, options: ReadOptions, through: ColumnDecoder
) -> tuple[dict[str, Table], list[Complaint]]:
    """The files of a run by name; of several, one that cannot be read is a complaint, and the others are judged. Raises Unreadable if none can."""
    tables, failed = dict[str, Table](), list[str]()
    for file in files:
        try:
            tables[file.name] = _table(file, choice, options, through)
        except Unreadable as error:
            failed.append(str(error))
    if not tables:
        raise Unreadable("; ".join(failed))
    return tables, [Complaint(name, "", text, fatal=True) for text in failed]


def _with_computed(table: Table, formulas: Sequence[str]) -> Table:
    """The table with a column for every formula whose columns it has. Raises Unreadable for a formula that cannot be computed."""
    there = {c.name for c in table.columns}
    own = [text for text in formulas if set(names_in(text, table.columns)) <= there]
    return replace(table, columns=[*table.columns, *(computed(text, table.columns) for text in own)])


def _dead_inputs(recording: Recording, channels: Model) -> list[Complaint]:
    """A complaint where no input of the model changes, so that nothing drives the outputs."""
    known = {n: recording.signals[n] for n in channels.inputs if n in recording.signals}
    if not known or any(np.unique(s.value[np.isfinite(s.value)]).size > 1 for s in known.values()):
        return []
    text = f"no input changes ({', '.join(known)}). Are these channels dead? Effects that only show when inputs change cannot be judged"
    return [Complaint(recording.name, "", text)]


def _table(path: Path, choice: Choice, options: ReadOptions, through: ColumnDecoder) -> Table:
    if path.is_dir():
        example = f"; {choice.name} reads a {choice.data}" if choice.data else ""
        raise Unreadable(f"{path.name}: is a folder without recordings of a known kind{example}")
    if is_table(path):
        return read_table(path, options.time)
    if not options.dbcs:
        raise Unreadable(
            f"{path.name}: is not a table (.csv, .csv.gz, .parquet); a recording of CAN frames needs --dbc FILE"
        )
    return read_can(path, through, options.bus)


def _check_names(model: Model, options: ReadOptions) -> None:
    known = {**model.driving, **model.outputs}
    for option, names in (("--channel", options.renamed), ("--shift", options.shifts)):
        if unknown := [name for name in names if name not in known]:
            raise Misuse(
                f"{option} {unknown[0]}=...: {model.name} has no such channel; it has {', '.join(known)}"
            )


def _different(runs: Sequence[Sequence[Path]]) -> list[Sequence[Path]]:
    """The runs, if all are different. Raises Misuse for a run that is given twice, also through a link."""
    known: list[list[Path]] = []
    for files in runs:
        resolved = [file.resolve() for file in files]
        if resolved in known:
            raise Misuse(f"{'+'.join(map(str, files))}: is given twice; its evidence would count twice")
        known.append(resolved)
    return list(runs)


def _named(runs: Sequence[Sequence[Path]]) -> dict[str, Sequence[Path]]:
    """The runs by name. Results refer to runs by name, so equal file names get a number."""
    found: dict[str, Sequence[Path]] = {}
    for files in runs:
        name = " + ".join(file.name for file in files)
        same = sum(known.split(" (")[0] == name for known in found)
        found[f"{name} ({same + 1})" if same else name] = files
    return found


def _with_options(recording: Recording, options: ReadOptions, constants: Mapping[str, float]) -> Recording:
    """The recording with the shifts [s] and constants of the command line, which replace its own."""
    signals = {
        name: Signal(s.time_s + options.shifts.get(name, 0.0), s.value, s.unit, s.held)
        for name, s in recording.signals.items()
    }
    return replace(recording, signals=signals, constants={**recording.constants, **constants})


def constants_of(model: Model, given: Mapping[str, tuple[float, str | None]]) -> dict[str, float]:
    """The values of --constant in the model's units. Raises Misuse for another quantity or a name that is not the model's."""
    found = {}
    for name, (value, unit) in given.items():
        if name not in model.constants:
            known = ", ".join(model.constants) or "none"
            raise Misuse(f"--constant '{name}': {model.name} has no such constant; it has {known}")
        try:
            found[name] = constant(model, name, value, unit)
        except ValueError as error:
            raise Misuse(f"--constant '{name} [{unit}]': {error}") from error
    return found


def pairs(option: str, texts: Sequence[str]) -> dict[str, str]:
    """Values by name, of a repeated option 'NAME=VALUE'. Raises Misuse."""
    found = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name.strip() or not value.strip():
            raise Misuse(f"{option} '{text}': must read NAME=VALUE")
        found[name.strip()] = value.strip()
    return found


def numbers(option: str, texts: Sequence[str]) -> dict[str, float]:
    """'NAME=VALUE' with numbers in SI; a name may have a unit: 'speed [km/h]=0.5'. Raises Misuse."""
    found = {}
    for name, (value, unit) in measured(option, texts).items():
        try:
            found[name] = value * (parse_scaled(unit).factor if unit else 1.0)
        except ValueError as error:
            raise Misuse(f"{option} '{name} [{unit}]': {error}") from error
    return found


def measured(option: str, texts: Sequence[str]) -> dict[str, tuple[float, str | None]]:
    """'NAME=VALUE' with numbers and their units, None without a unit: 'diameter [cm]=6.7'. Raises Misuse."""
    found = {}
    for key, value in pairs(option, texts).items():
        name, unit = heading(key)
        try:
            found[name] = (float(value), unit)
        except ValueError:
            raise Misuse(f"{option} '{key}={value}': '{value}' is not a number") from None
    return found


@dataclass(frozen=True, slots=True)
class Assigned:
    """The columns and units that `--channel` assigns."""

    columns: Mapping[str, str]  # channel -> column, columns by comma, or formula
    units: Mapping[str, str]  # channel -> unit in place of that of the heading
    time: tuple[str, str | None] | None  # column of time and its unit


def assigned(texts: Sequence[str]) -> Assigned:
    """Columns and units of 'speed=v', 'speed [km/h]=v', 'power=voltage * current', 'time [ms]=clock'. Raises Misuse."""
    columns, units = {}, {}
    for key, column in pairs("--channel", texts).items():
        name, unit = heading(key)
        columns[name] = column
        if unit is not None:
            units[name] = unit
    clock = columns.pop("time", None)
    return Assigned(columns, units, None if clock is None else (clock, units.pop("time", None)))
