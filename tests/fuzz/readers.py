"""Every reader of foreign bytes: its corpus, and what it may raise. Anything else, a hang, or a gigabyte is a defect."""

import contextlib
import random
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from bus.hub import packet
from bus.user_error import UserError
from tests.fuzz.mutate import mutated

CORPUS = Path(__file__).with_name("corpus")
LONGEST_S = 10.0
MOST_MIB = 1024


@dataclass(frozen=True, slots=True)
class Reader:
    """What reads files of one kind."""

    suffix: str
    """Of the files in the corpus, and of the mutated ones."""
    read: Callable[[Path], object]
    """Reads a file; returns something, or raises one of `permitted`."""
    permitted: tuple[type[BaseException], ...] = (UserError,)


def _recording(file: Path) -> object:
    from dbc.recordings.reading import read_frames

    table = read_frames(file)
    return [*table.frames()] if len(table) < 1000 else len(table)


def _dbc(file: Path) -> object:
    from dbc.database import Database

    database = Database.from_file(file, strict=False)
    for codec in database.by_name.values():
        with contextlib.suppress(ValueError):  # DecodeError: an unknown multiplexer
            codec.decode_dict(bytes(codec.length))
    return database


def _faults(file: Path) -> object:
    from dbc import loader_database
    from hil.faults.table import faults_of

    return faults_of(file, loader_database(), alone=True)


def _run(file: Path) -> object:
    """A run directory whose run.json is the file; its truth and log are no such files at all."""
    from hil.rundir import BUS, RECORD, TRUTH, RunDirectory

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for part in (RECORD, TRUTH):
            (folder / part).write_bytes(file.read_bytes())
        (folder / BUS).write_bytes((CORPUS / "drive.log").read_bytes())
        return RunDirectory.read(folder)


def _faults_of_run(file: Path) -> object:
    from hil.faults.record import read_faults
    from hil.rundir import FAULTS

    with tempfile.TemporaryDirectory() as name:
        (Path(name) / FAULTS).write_bytes(file.read_bytes())
        return read_faults(Path(name))


def _hub_control(file: Path) -> object:
    return packet.read_control(file.read_bytes())


def _control_socket(file: Path) -> object:
    from bus.bounded_json import read_object
    from hil.faults.control import REQUEST_LIMIT
    from tests.hil.faults.traffic import injector

    return injector().command(read_object(file.read_bytes(), REQUEST_LIMIT), 1_000_000_000)


READERS: dict[str, Reader] = {
    "candump": Reader(".log", _recording),
    "asc": Reader(".asc", _recording),
    "blf": Reader(".blf", _recording),
    "mf4": Reader(".mf4", _recording),
    "dbc": Reader(".dbc", _dbc),
    "toml": Reader(".toml", _faults),
    "run folder": Reader(".json", _run),
    "faults of a run": Reader(".faults", _faults_of_run),
    "hub": Reader(".hub", _hub_control, (ValueError,)),
    "control socket": Reader(".command", _control_socket, (ValueError,)),
}


@dataclass(slots=True)
class Outcome:
    """What a number of mutated files came to."""

    files: int = 0
    read: int = 0
    """Files that were read, wholly or in part."""
    slowest_s: float = 0.0
    peak_mib: float = 0.0
    """Largest resident memory of the process so far."""
    defects: list[tuple[int, str]] = field(default_factory=list)
    """Number of the mutation, and what went wrong."""


def fuzz(name: str, count: int, folder: Path, first: int = 0) -> Outcome:
    """Read `count` mutations of the corpus of a reader, numbered from `first`; a number always gives the same bytes."""
    reader, outcome = READERS[name], Outcome()
    files = sorted(CORPUS.glob(f"*{reader.suffix}"))
    assert files, f"the corpus of {name} is empty"
    for known in files:
        reader.read(known)  # what is compiled and loaded on first use takes no file's time
    seeds = [known.read_bytes() for known in files]
    held_mib = _memory_mib("VmRSS")  # what other tests of this process have loaded
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # the peak counts from here, proc(5)
    file = folder / f"mutated{reader.suffix}"
    for number in range(first, first + count):
        rng = random.Random(f"{name}/{number}")
        file.write_bytes(mutated(rng.choice(seeds), seeds, rng))
        begun = time.perf_counter()
        try:
            reader.read(file)
            outcome.read += 1
        except reader.permitted as error:
            if "\n" in str(error).strip() and isinstance(error, UserError):
                outcome.defects.append((number, f"more than one line: {error}"))
        except Exception as error:
            outcome.defects.append((number, f"{type(error).__name__}: {error}"))
        outcome.slowest_s = max(outcome.slowest_s, time.perf_counter() - begun)
        outcome.files += 1
    outcome.peak_mib = _memory_mib("VmHWM") - held_mib
    if outcome.slowest_s > LONGEST_S:
        outcome.defects.append((-1, f"a file took {outcome.slowest_s:.1f} s"))
    if outcome.peak_mib > MOST_MIB:
        outcome.defects.append((-1, f"{outcome.peak_mib:.0f} MiB"))
    return outcome


def _memory_mib(field: str) -> float:
    """A field of this process's memory in /proc/self/status, in MiB."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    (found,) = (line for line in lines if line.startswith(f"{field}:"))
    return int(found.split()[1]) / 1024
