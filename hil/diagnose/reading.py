"""All recordings of one diagnosis, whatever their kind: read, or told why not."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from bus.mistake import Mistake
from discrepancy.model import Model
from discrepancy.recording import Complaint, Recording, Signal
from discrepancy.search import Progress
from discrepancy.units import parse_scaled
from hil.diagnose.models import Choice, NoModel
from hil.diagnose.tables import Unreadable, heading, is_table, read_table, to_recording


class Misuse(Mistake, ValueError):
    """The command line asks for something that cannot be."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ask:
    """What is to be read and how. renamed: channel -> column; shifts: channel -> seconds added to its stamps;
    constants: name -> value in SI.
    """

    paths: Sequence[Path]
    part: str | None = None
    renamed: Mapping[str, str] = field(default_factory=dict)
    shifts: Mapping[str, float] = field(default_factory=dict)
    constants: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Read:
    """What there was, and what is to be complained of."""

    recordings: Sequence[Recording]
    complaints: Sequence[Complaint]


def read_all(choice: Choice, ask: Ask, progress: Progress) -> Read:
    """Every path as recordings; a file that cannot be read is a complaint, so that the others are judged all the same."""
    channels = choice.channels
    _check_names(channels, ask)
    recordings: list[Recording] = []
    complaints: list[Complaint] = []
    for path in ask.paths:
        if not path.exists():
            raise Misuse(f"{path}: no such file or folder")
    for path in ask.paths:
        progress(f"reading {path.name}")
        try:
            found, said = _read(path, choice, channels, ask)
        except NoModel:
            raise
        except (OSError, EOFError, ValueError, KeyError) as error:
            text = str(error).removeprefix(f"{path.name}: ")
            complaints.append(Complaint(path.name, "", text, fatal=True))
            continue
        recordings += found
        complaints += said
    return Read([_mended(r, ask) for r in _distinct(recordings)], complaints)


def _read(path: Path, choice: Choice, channels: Model, ask: Ask) -> tuple[list[Recording], list[Complaint]]:
    native = choice.native(path, ask.part)
    if native is not None:
        return native, []
    if path.is_dir():
        example = f"; {choice.name} reads a {choice.data}" if choice.data else ""
        raise Unreadable(f"{path.name}: is a folder without recordings of a known kind{example}")
    if is_table(path):
        recording, said = to_recording(read_table(path), path.name, channels, ask.renamed)
        return [recording], said
    raise Unreadable(f"{path.name}: unknown kind of file; tables end in .csv, .csv.gz or .parquet")


def _check_names(model: Model, ask: Ask) -> None:
    known = {**model.inputs, **model.optional, **model.outputs}
    for option, names in (("--channel", ask.renamed), ("--shift", ask.shifts)):
        if unknown := [name for name in names if name not in known]:
            raise Misuse(
                f"{option} {unknown[0]}=...: {model.name} has no such channel; it has {', '.join(known)}"
            )


def _distinct(recordings: Sequence[Recording]) -> list[Recording]:
    """Names are how results refer to recordings, so no two may share one."""
    seen: dict[str, int] = {}
    named = []
    for r in recordings:
        seen[r.name] = seen.get(r.name, 0) + 1
        named.append(r if seen[r.name] == 1 else replace(r, name=f"{r.name} ({seen[r.name]})"))
    return named


def _mended(recording: Recording, ask: Ask) -> Recording:
    signals = {
        name: Signal(s.time_s + ask.shifts.get(name, 0.0), s.value, s.unit, s.held)
        for name, s in recording.signals.items()
    }
    return replace(recording, signals=signals, constants={**recording.constants, **ask.constants})


def pairs(option: str, texts: Sequence[str]) -> dict[str, str]:
    """'NAME=VALUE' of a repeated option."""
    found = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name.strip() or not value.strip():
            raise Misuse(f"{option} '{text}': must read NAME=VALUE")
        found[name.strip()] = value.strip()
    return found


def numbers(option: str, texts: Sequence[str]) -> dict[str, float]:
    """The same with numbers; a name may carry a unit: 'diameter [cm]=6.7' comes out in SI."""
    found = {}
    for key, value in pairs(option, texts).items():
        name, unit = heading(key)
        try:
            found[name] = float(value) * (parse_scaled(unit).factor if unit else 1.0)
        except ValueError as error:
            raise Misuse(f"{option} '{key}={value}': {error}") from error
    return found
