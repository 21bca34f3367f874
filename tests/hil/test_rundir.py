"""What is written is read back; what is missing, damaged or foreign is named, and the rest still reads."""

import json
import zipfile
from dataclasses import replace

import numpy as np
import pytest

from bus.frame import Frame
from dbc import loader_database
from dbc.recordings.writer import CandumpWriter
from hil import rundir
from hil.rundir import RunDirectory, RunError, RunRecord
from plant.recorder import TruthRecorder
from plant.truth import Truth

RECORD = RunRecord(
    scenario="loaded",
    machine="l60",
    mode="lockstep",
    form="corrected",
    limits=True,
    seed=3,
    payload_kg=3204.0,
    started="2026-01-01T00:00:00+00:00",
)
TICKS = 20
FORCES = np.array([(1.0, 2.0, 3.0, float(tick)) for tick in range(TICKS)])
CODEC = loader_database().by_name["SlopeSensor"]


def write_log(path, first_ns=0):
    with CandumpWriter(path / rundir.BUS) as log:
        for tick in range(TICKS):
            angle = 0.002 * tick
            log.write(
                Frame(CODEC.can_id, CODEC.encode([angle, -angle, 0.0]), first_ns + tick * 10_000_000),
                "loader",
            )


@pytest.fixture
def path(tmp_path):
    """A complete lockstep run."""
    path = tmp_path / "run"
    rundir.begin(path, RECORD)
    rundir.write_table(path / rundir.TRUTH, {"time_s": 0.01 * np.arange(TICKS), "normal_force": FORCES})
    write_log(path)
    rundir.write_record(path, replace(RECORD, outcome="finished", statistics={"ticks": TICKS}))
    return path


def test_a_run_reads_back_as_written(path):
    run = RunDirectory.read(path)
    assert run.problems == ()
    assert run.record == replace(RECORD, outcome="finished", statistics={"ticks": TICKS})
    assert run.truth["time_s"] == pytest.approx(0.01 * np.arange(TICKS))
    assert run.truth["normal_force"].shape == (TICKS, 4)
    slope = run.messages["SlopeSensor"]
    assert slope.time_s == pytest.approx(0.01 * np.arange(TICKS))
    assert slope.signals["PitchAngle"] == pytest.approx(0.002 * np.arange(TICKS))


def test_bus_stamps_of_a_real_time_run_are_put_on_the_clock_of_the_truth(path):
    """The plant's tick k was due at start + 10 ms k; it missed two ticks, in which its own clock stood still."""
    rundir.write_record(path, replace(RECORD, mode="realtime", outcome="finished"))
    start = 5_000_000_000_000
    due = start + 10_000_000 * np.concatenate((np.arange(10), np.arange(12, 22)))
    rundir.write_table(path / rundir.TIMING, {"plant_due_ns": due})
    write_log(path, first_ns=start - 30_000_000)
    times = RunDirectory.read(path).messages["SlopeSensor"].time_s
    assert times[:13] == pytest.approx(0.01 * np.arange(-3, 10), abs=2e-6)
    assert times[16:] == pytest.approx(0.01 * np.arange(11, 15), abs=2e-6)
    assert np.all(np.diff(times) > 0)


def test_without_the_plants_stamps_the_first_frame_is_time_zero(path):
    rundir.write_record(path, replace(RECORD, mode="realtime"))
    write_log(path, first_ns=7_000_000_000)
    run = RunDirectory.read(path)
    assert run.messages["SlopeSensor"].time_s[[0, -1]] == pytest.approx([0.0, 0.19])
    assert any("timing.npz: missing" in problem for problem in run.problems)


def test_a_killed_run_reads_with_its_problems_named(path):
    rundir.write_record(path, RECORD)
    (path / rundir.TRUTH).unlink()
    log = path / rundir.BUS
    log.write_bytes(log.read_bytes()[:-7])
    run = RunDirectory.read(path)
    assert len(run.messages["SlopeSensor"].time_s) == TICKS - 1
    assert len(run.truth) == 0
    text = "\n".join(run.problems)
    assert "run.json: the run was killed" in text
    assert "truth.npz: missing" in text


def test_the_truth_of_a_killed_plant_is_read_from_its_rows(path):
    with np.load(path / rundir.TRUTH) as archive:
        written = {name: archive[name] for name in archive.files}
    (path / rundir.TRUTH).unlink()
    with TruthRecorder(path / rundir.TRUTH) as recorder:
        for k in range(7):
            recorder.append(Truth(np.full(Truth.size, k * 0.01)))
    run = RunDirectory.read(path)
    assert len(run.truth["time_s"]) == 7
    assert any("rows up to then are read instead" in problem for problem in run.problems)
    rundir.keep_truth(path)
    assert not (path / rundir.TRUTH_ROWS).exists()
    assert set(written) <= set(RunDirectory.read(path).truth)


def test_truth_cut_off_in_a_copy_is_named_and_the_log_still_reads(path):
    truth = path / rundir.TRUTH
    truth.write_bytes(truth.read_bytes()[:400])
    run = RunDirectory.read(path)
    assert any("truth.npz: unreadable" in problem for problem in run.problems)
    assert "SlopeSensor" in run.messages


@pytest.mark.parametrize("content", [b"", b"no array", "text"])
def test_a_column_of_the_truth_that_is_no_array_of_numbers_is_named(path, content):
    truth = path / rundir.TRUTH
    with np.load(truth) as archive:
        columns = {name: archive[name] for name in archive.files} | {"mass": np.zeros(3)}
    if isinstance(content, str):
        np.savez(truth, **columns | {"mass": np.array([content])})
    else:
        np.savez(truth, **{name: column for name, column in columns.items() if name != "mass"})
        with zipfile.ZipFile(truth, "a") as archive:
            archive.writestr("mass.npy", content)
    run = RunDirectory.read(path)
    assert any("truth.npz: unreadable ('mass' holds no numbers)" in problem for problem in run.problems)
    assert "SlopeSensor" in run.messages


def test_damaged_lines_are_named_by_number(path):
    log = path / rundir.BUS
    lines = log.read_text().splitlines()
    lines[4] = "(0.04 nonsense"
    log.write_text("\n".join(lines) + "\n")
    run = RunDirectory.read(path)
    assert len(run.messages["SlopeSensor"].time_s) == TICKS - 1
    assert any("bus.log: line 5" in problem for problem in run.problems)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"seed": "three"}, "seed"),
        ({"mode": "backwards"}, "mode"),
        ({"payload": 3}, "payload"),
        ({"limits": "no"}, "limits"),
    ],
)
def test_a_wrong_record_is_refused_with_file_and_key(path, change, named):
    file = path / rundir.RECORD
    file.write_text(json.dumps(json.loads(file.read_text()) | change))
    with pytest.raises(RunError, match=rf"run\.json: {named}"):
        RunDirectory.read(path)


def test_a_folder_that_is_no_run_and_one_that_is_not_there(tmp_path):
    with pytest.raises(RunError, match=r"has no run\.json"):
        RunDirectory.read(tmp_path)
    with pytest.raises(RunError, match="no such run directory"):
        RunDirectory.read(tmp_path / "nowhere")
    (tmp_path / "bus.log").touch()
    with pytest.raises(RunError, match=r"bus\.log: is a file; a run is named by its folder"):
        RunDirectory.read(tmp_path / "bus.log")


def test_a_missing_column_is_an_error_that_says_what_there_is(path):
    with pytest.raises(RunError, match="no column 'rool'; it has time_s, normal_force"):
        RunDirectory.read(path).truth["rool"]


def test_a_new_run_in_the_same_place_leaves_nothing_of_the_old(path):
    rundir.write_table(rundir.part_of_timing(path, "ecu"), {"lateness_ns": np.arange(3)})
    rundir.begin(path, RECORD)
    assert {file.name for file in path.iterdir()} == {rundir.RECORD, rundir.ROOM}


def test_the_record_of_the_end_gives_the_reserved_room_back(path):
    rundir.begin(path, RECORD)
    assert (path / rundir.ROOM).stat().st_size == rundir.ROOM_BYTES
    rundir.write_record(path, replace(RECORD, outcome="failed"))
    assert not (path / rundir.ROOM).exists()


def test_a_folder_with_other_things_in_it_is_not_touched(tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(RunError, match="not empty"):
        rundir.begin(tmp_path, RECORD)
    assert (tmp_path / "thesis.txt").read_text() == "mine"


def test_the_parts_of_the_processes_become_one_timing(path):
    rundir.write_table(rundir.part_of_timing(path, "plant"), {"lateness_ns": np.arange(3)})
    rundir.write_table(rundir.part_of_timing(path, "ecu"), {"lateness_ns": np.arange(4)})
    rundir.merge_timing(path)
    timing = RunDirectory.read(path).timing
    assert set(timing) == {"plant_lateness_ns", "ecu_lateness_ns"}
    assert not list(path.glob("timing.*.npz"))
