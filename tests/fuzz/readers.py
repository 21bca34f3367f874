"""Every reader of foreign bytes: its corpus, and what it may raise. Anything else is a defect."""

import contextlib
import functools
import gzip
import importlib
import random
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from bus.hub import packet
from bus.user_error import UserError
from tests.fuzz import beside
from tests.fuzz.mutate import mutated

CORPUS = Path(__file__).with_name("corpus")
ROOT = Path(__file__).parents[2]


@dataclass(frozen=True, slots=True)
class Reader:
    """What reads files of one kind."""

    suffix: str
    """Of the mutated files, and of those in the corpus."""
    read: Callable[[Path], object]
    """Reads a file; returns something, or raises one of `permitted`."""
    permitted: tuple[type[BaseException], ...] = (UserError,)
    seeds: str = ""
    """Files of the project that are mutated, as a pattern below its root; by default those in the corpus with the suffix."""
    unpack: Callable[[bytes], bytes] | None = None
    """What a packed file holds. Half of its mutations are made inside, because a checksum finds those made outside."""
    pack: Callable[[bytes], bytes] | None = None
    """The file that holds these bytes."""


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


def _hub_control(file: Path) -> object:
    return packet.read_control(file.read_bytes())


def _control_socket(file: Path) -> object:
    from bus.bounded_json import read_object
    from hil.faults.control import REQUEST_LIMIT
    from tests.hil.faults.traffic import injector

    return injector().command(read_object(file.read_bytes(), REQUEST_LIMIT), 1_000_000_000)


def _mqtt(file: Path) -> object:
    """A message on the topic of commands; it gets an answer whatever it is."""
    from hil.mqtt.commands import Commands

    return Commands(Path("/nonexistent/control"), "0123456789abcdef").obey(file.read_bytes())


def _truth_rows(file: Path) -> object:
    from plant.recorder import read_rows

    return {name: column.copy() for name, column in read_rows(file).items()}


def _readings(file: Path) -> object:
    """A sheet of a tyre's contact, and the laws through it."""
    from identify.contact import readings_of

    return readings_of(file, "l60")


def _by(module: str, name: str) -> Callable[[Path], object]:
    """The function NAME of a module that takes a path, imported on first use: a worker loads only what it reads with."""

    def read(file: Path) -> object:
        function = importlib.import_module(module)
        for part in name.split("."):
            function = getattr(function, part)
        return function(file)  # type: ignore[operator]

    return read


def _expectations(file: Path) -> object:
    from dbc import loader_database
    from testbench.expect.table import expectations_of

    return expectations_of(file, loader_database(), alone=True)


def _tolerances(file: Path) -> object:
    from dbc import loader_database
    from testbench.compare.tolerances import Tolerances

    return Tolerances.from_file(file, loader_database())


_GZIP = {"unpack": gzip.decompress, "pack": functools.partial(gzip.compress, compresslevel=1, mtime=0)}

READERS: dict[str, Reader] = {
    "candump": Reader(".log", _recording),
    "candump, packed": Reader(".log.gz", _recording, **_GZIP),
    "asc": Reader(".asc", _recording),
    "blf": Reader(".blf", _recording),
    "mf4": Reader(".mf4", _recording),
    "dbc": Reader(".dbc", _dbc),
    "table, csv": Reader(".csv", _by("diagnosis.reading.tables", "read_table")),
    "table, packed": Reader(".csv.gz", _by("diagnosis.reading.tables", "read_table"), **_GZIP),
    "table, parquet": Reader(".parquet", _by("diagnosis.reading.tables", "read_table")),
    "findings": Reader(
        ".json",
        _by("diagnosis.findings_file", "read_findings"),
        seeds="tests/diagnosis/old_files/findings.json",
    ),
    "weighings": Reader(".weighings", _by("identify.machine.files", "read_weighings")),
    "sheet of readings": Reader(".readings", _readings),
    "car log": Reader(".car", _by("identify.car.log", "read_car")),
    "car log, packed": Reader(".car.gz", _by("identify.car.log", "read_car"), **_GZIP),
    "faults": Reader(".toml", _faults),
    "scenario": Reader(".toml", _by("plant.unit.scenario", "load_scenario"), seeds="plant/scenarios/*.toml"),
    "machine": Reader(".toml", _by("plant.sheets.machine", "load_machine"), seeds="plant/machines/*.toml"),
    "tyre file": Reader(".tir", _by("plant.sheets.tyre_file", "read_tir")),
    "calibration": Reader(
        ".toml", _by("ecu.calibration", "load_calibration"), seeds="ecu/calibrations/*.toml"
    ),
    "routes": Reader(".routes", _by("hil.gateway.settings", "read_settings")),
    "expectations": Reader(".expect", _expectations),
    "tolerances": Reader(".compare", _tolerances),
    "rest bus values": Reader(
        ".toml", _by("testbench.restbus.values", "Values.from_file"), seeds="dbc/*.values.toml"
    ),
    "run folder": Reader(".json", beside.run_folder),
    "truth of a run": Reader(".npz", beside.truth_of_a_run),
    "rows of the truth": Reader(".rows", _truth_rows, (ValueError,)),
    "stamps": Reader(".stamps", _by("hil.gateway.tap", "read_stamps")),
    "faults of a run": Reader(".faults", beside.faults_of_a_run),
    "hub's control": Reader(".hub", _hub_control, (ValueError,)),
    "control socket": Reader(".command", _control_socket, (ValueError,)),
    "mqtt command": Reader(".mqtt", _mqtt),
    "equipment": Reader(
        ".toml", _by("plant.unit.equipment", "load_equipment"), seeds="plant/equipment_sets/*.toml"
    ),
    "bench of a record": Reader(".bench", beside.bench_of_a_record),
    "deployed ECU": Reader(
        ".toml", _by("deploy.settings", "ServiceSettings.from_file"), seeds="deploy/*.toml"
    ),
    "rig": Reader(".rig", beside.rig),
    "field test": Reader(".field", beside.field),
    "map of the ground": Reader(".ground", beside.ground),
    "matlab": Reader(".mat", beside.matlab),
    "identification": Reader(".identification", beside.identification),
    "sealed truth": Reader(
        ".sealed",
        _by("diagnosis.blind.seal", "unseal"),
        unpack=beside.unpacked_truth,
        pack=beside.packed_truth,
    ),
    "applied findings": Reader(".with", beside.extension),
    "fmu": Reader(".fmu", beside.fmu, unpack=beside.unpacked_fmu, pack=beside.packed_fmu),
    "fmu's companion": Reader(".companion", beside.companion),
}
"""Permitted is a UserError, which the command line turns into one line; ValueError where the caller answers the sender with it."""


def seeds_of(name: str) -> list[Path]:
    """The files that are mutated for a reader."""
    files = sorted(ROOT.glob(READERS[name].seeds or f"tests/fuzz/corpus/*{READERS[name].suffix}"))
    # "drive.csv.gz" must not become a seed of ".gz": a suffix begins at the first point of the name
    files = [file for file in files if READERS[name].seeds or file.name.endswith(READERS[name].suffix)]
    assert files, f"the corpus of {name} is empty"
    return files


class MutatedFiles:
    """The cases of one reader: a number always gives the same bytes."""

    def __init__(self, name: str, folder: Path) -> None:
        """folder: for the files that are written anew for every case. The seeds themselves have to be read."""
        self._name, self._reader = name, READERS[name]
        self._folder = folder
        known = seeds_of(name)
        # with its name, because a scenario has to be called as its file is
        self._seeds = [(file.name, file.read_bytes()) for file in known]
        for file in known:
            self._read(file)  # what is compiled and loaded on first use takes no case's time

    def _read(self, file: Path) -> None:
        # a library that warns or logs about damage has not failed
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self._reader.read(file)

    def _mutation(self, rng: random.Random) -> tuple[str, bytes]:
        """Name and content of a file."""
        name, seed = rng.choice(self._seeds)
        unpack, pack = self._reader.unpack, self._reader.pack
        if unpack is None or pack is None or rng.random() < 0.5:
            return name, mutated(seed, [content for _, content in self._seeds], rng)
        return name, pack(mutated(unpack(seed), [unpack(seed)], rng))

    def __call__(self, number: int) -> tuple[int, int]:
        """Read one mutation; returns (1, whether it was read). AssertionError, or whatever the reader must not raise."""
        rng = random.Random(f"{self._name}/{number}")
        name, content = self._mutation(rng)
        file = self._folder / name
        file.write_bytes(content)
        try:
            self._read(file)
        except self._reader.permitted as error:
            if "\n" in str(error).strip():
                raise AssertionError(f"more than one line: {error}") from error
            return 1, 0
        return 1, 1
