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
from dbc.j1939 import identifier_text
from dbc.recordings.reading import read_frames
from dbc.recordings.writer import candump_line
from dbc.tables import load_databases
from hil.recording.decode import register
from hil.recording.formats import open_writer
from hil.recording.ring import records_of
from plant.sheets.machine import load_machine
from plant.unit.scenario import load_scenario
from plant.unit.unit import PlantUnit

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


def test_damage_and_strangers_are_reported_and_skipped(log, tmp_path):
    file = tmp_path / "damaged.log"
    lines = log.read_text().splitlines()
    lines[7:7] = ["(0.1) can0 123#11", "(0.1) can0 18FEF200#00", "rubbish"]
    file.write_text("\n".join(lines))
    result = run(file)
    assert result.exit_code == 0
    assert "line 10:" in result.output
    assert "0x123, 1 frames" in result.output
    assert "LFE: 1 frames shorter than the DBC says; signals outside them left empty" in result.output


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


def test_of_a_short_frame_the_signals_within_it_are_decoded_as_cantools_does(tmp_path):
    """Cut at every length, both byte orders: what lies within is equal, what does not is empty."""
    dbc = tmp_path / "short.dbc"
    dbc.write_text(
        'VERSION ""\nNS_ :\nBS_:\nBU_: A\nBO_ 291 Mixed: 8 A\n'
        ' SG_ One : 0|8@1+ (1,0) [0|0] "" A\n SG_ Two : 12|9@1- (0.5,1) [0|0] "" A\n'
        ' SG_ Three : 31|16@0+ (1,0) [0|0] "" A\n SG_ Four : 43|10@0- (2,0) [0|0] "" A\n'
    )
    log = tmp_path / "short.log"
    data = bytes.fromhex("A1B2C3D4E5F60718")
    log.write_text("".join(f"({n}.0) can0 123#{data[:n].hex()}\n" for n in range(1, 9)))
    result = run(log, "--dbc", dbc, "--out", tmp_path / "out")
    assert result.exit_code == 0
    assert "Mixed: 7 frames shorter than the DBC says; signals outside them left empty" in result.output
    reference = cantools.database.load_file(dbc).get_message_by_name("Mixed")
    with (tmp_path / "out" / "Mixed.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 8
    for n, row in enumerate(rows, 1):
        theirs = reference.decode(data[:n], decode_choices=False, allow_truncated=True)
        ours = {name: float(value) for name, value in row.items() if name != "time_s" and value != "nan"}
        assert ours == theirs


def test_an_empty_log_is_one_clear_error(tmp_path):
    empty = tmp_path / "empty.log"
    empty.touch()
    result = run(empty)
    assert result.exit_code == 1
    assert "empty.log: the recording is empty (0 bytes)" in result.output


@pytest.mark.parametrize("suffix", [".blf", ".asc", ".mf4"])
def test_other_formats_give_the_same_tables(log, tmp_path, suffix):
    table = read_frames(log)
    other = tmp_path / f"drive{suffix}"
    writer = open_writer(other, table.channels)
    writer.write(records_of(list(table.frames())))
    writer.close()
    for source, name in ((log, "a"), (other, "b")):
        assert run(source, "--out", tmp_path / name).exit_code == 0
    for file in (tmp_path / "a").iterdir():
        ours, theirs = (list(csv.reader((tmp_path / n / file.name).read_text().splitlines())) for n in "ab")
        assert [row[1:] for row in ours] == [row[1:] for row in theirs]


def test_several_channels_have_a_column_and_can_be_chosen(log, tmp_path):
    both = tmp_path / "both.log"
    lines = log.read_text().splitlines()
    both.write_text(
        "".join(f"{line if k % 3 else line.replace('can0', 'can1')}\n" for k, line in enumerate(lines))
    )
    assert run(both, "--out", tmp_path / "out").exit_code == 0
    with (tmp_path / "out" / "Articulation.csv").open() as stream:
        channels = [row["channel"] for row in csv.DictReader(stream)]
    assert set(channels) == {"can0", "can1"}
    assert run(both, "--out", tmp_path / "one", "--channel", "can1").exit_code == 0
    with (tmp_path / "one" / "Articulation.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == channels.count("can1")
    assert "channel" not in rows[0]
    result = run(both, "--channel", "can7")
    assert result.exit_code == 1
    assert "no channel 'can7'; there are can" in result.output


def test_j1939_matches_by_group_what_the_dbc_does_not_mark(tmp_path):
    dbc = tmp_path / "unmarked.dbc"
    dbc.write_text(
        'VERSION ""\nNS_ :\nBS_:\nBU_: A\nBO_ 2566844672 CCVS: 8 A\n SG_ Speed : 8|16@1+ (0.00390625,0) [0|250] "km/h" A\n'
    )
    log = tmp_path / "a.log"
    log.write_text("(1.0) can0 18FEF103#0000320000000000\n(2.0) can0 0CFEF117#0000640000000000\n")
    assert "in no DBC: 2 frames" in run(log, "--dbc", dbc).output
    assert run(log, "--dbc", dbc, "--j1939", "--out", tmp_path / "out").exit_code == 0
    with (tmp_path / "out" / "CCVS.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [(float(row["Speed [km/h]"]), row["source_address"]) for row in rows] == [
        (50.0, "3"),
        (100.0, "23"),
    ]
