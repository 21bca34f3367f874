"""`loaderhil decode`: tables equal to cantools, what cannot be decoded is named, nothing is lost to a bad file."""

import csv
import math

import cantools
import pyarrow.parquet as pq
import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from bus.frame import ERROR, EXTENDED, REMOTE
from dbc import FOLDER, loader_database
from dbc.writer import candump_line
from hil.decode import identifier_text, load_databases, register
from plant.machine import load_machine
from plant.scenario import load_scenario
from plant.unit import PlantUnit

TOOL = CliRunner()
APP = typer.Typer()
register(APP)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Two seconds of the machine's frames."""
    scenario = load_scenario("standstill")
    unit = PlantUnit(load_machine(scenario.machine), scenario, seed=1)
    file = tmp_path_factory.mktemp("log") / "drive.log"
    with file.open("w") as out:
        for tick in range(200):
            for frame in unit.tick(tick * 10_000_000):
                out.write(candump_line(frame._replace(at_ns=tick * 10_000_000), "can0") + "\n")
    return file


def run(*arguments):
    return TOOL.invoke(APP, [*map(str, arguments)])


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_tables_hold_cantools_values(log, tmp_path, form):
    result = run(log, "--out", tmp_path, "--format", form)
    assert result.exit_code == 0, result.output
    reference = cantools.database.load_file(FOLDER / "loader.dbc")
    expected = {}
    for line in log.read_text().splitlines():
        identifier, data = line.split(" ")[2].split("#")
        message = reference.get_message_by_frame_id(int(identifier, 16))
        expected.setdefault(message.name, []).append(
            message.decode(bytes.fromhex(data), decode_choices=False)
        )
    assert {file.stem for file in tmp_path.iterdir()} == set(expected)
    for name, rows in expected.items():
        if form == "csv":
            with (tmp_path / f"{name}.csv").open() as stream:
                read = [
                    {key.split(" [")[0]: float(v) for key, v in row.items()} for row in csv.DictReader(stream)
                ]
        else:
            read = pq.read_table(tmp_path / f"{name}.parquet").to_pylist()
        assert len(read) == len(rows)
        for ours, theirs in zip(read, rows, strict=True):
            assert all(ours[signal] == value or math.isnan(value) for signal, value in theirs.items())


def test_units_travel_with_the_table(log, tmp_path):
    run(log, "--out", tmp_path, "--format", "csv")
    header = (tmp_path / "Articulation.csv").read_text().splitlines()[0]
    assert "ArticulationAngle [deg]" in header
    run(log, "--out", tmp_path, "--format", "parquet")
    schema = pq.read_schema(tmp_path / "Articulation.parquet")
    assert schema.field("ArticulationAngle").metadata[b"unit"] == b"deg"
    assert schema.metadata[b"message"] == b"Articulation"


def test_several_recordings_get_a_folder_each(log, tmp_path):
    other = tmp_path / "second.log"
    other.write_text(log.read_text())
    assert run(log, other, "--out", tmp_path / "out").exit_code == 0
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["drive", "second"]


def test_damage_and_strangers_are_told_and_skipped(log, tmp_path):
    file = tmp_path / "damaged.log"
    lines = log.read_text().splitlines()
    lines[7:7] = ["(0.1) can0 123#11", "(0.1) can0 18FEF200#00", "rubbish"]
    file.write_text("\n".join(lines))
    result = run(file)
    assert result.exit_code == 0
    assert "line 10:" in result.output
    assert "0x123, 1 frames" in result.output
    assert "LFE: 1 frames shorter" in result.output


def test_one_bad_file_does_not_lose_the_good_one(log, tmp_path):
    result = run(tmp_path / "none.log", log, "--out", tmp_path / "out")
    assert result.exit_code == 1
    assert "none.log" in result.output
    assert (tmp_path / "out" / "drive" / "Articulation.csv").exists()


def test_a_bad_dbc_is_misuse_and_named(log, tmp_path):
    bad = tmp_path / "bad.dbc"
    bad.write_text("nonsense")
    result = run(log, "--dbc", bad)
    assert result.exit_code == 2
    assert "bad.dbc" in result.output


def test_identifiers_are_named_as_people_write_them():
    assert identifier_text(0x123) == "0x123"
    assert identifier_text(0x18FEF200 | EXTENDED) == "0x18FEF200 (PGN 65266 LFE)"
    assert identifier_text(0x0CEF0603 | EXTENDED) == "0x0CEF0603 (PGN 61184 PropA)"
    assert identifier_text(0x18FF1234 | EXTENDED) == "0x18FF1234 (PGN 65298 PropB)"
    assert identifier_text(0x123 | REMOTE) == "0x123 (remote)"
    assert identifier_text(0x88 | ERROR).startswith("error frame")


@given(st.integers(0, 0x1FFFFFFF))
def test_every_extended_identifier_has_a_text(number):
    assert identifier_text(number | EXTENDED).startswith(f"0x{number:08X} (PGN ")


def test_our_own_files_are_the_default():
    names = [name for database in load_databases([]) for name in database.by_name]
    assert set(loader_database().by_name) < set(names)
    assert "EEC1" in names


@pytest.mark.data
def test_a_real_tractor(recordings):
    result = run(recordings / "tractorhacking_j1939" / "idling.candump.log")
    assert result.exit_code == 0
    assert "EEC1" in result.output
    assert "PropA" in result.output
