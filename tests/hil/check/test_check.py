"""`loaderhil check`: a lockstep run is in time; every single fault put into it is found in its message and nowhere else."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from bus.frame import EXTENDED
from dbc import FOLDER, loader_database
from dbc.database import Database
from dbc.recordings.logfile import Damage
from dbc.recordings.writer import candump_line
from hil import rundir
from hil.check.check import Rules, check
from hil.check.command import register
from hil.compose import Choice, lockstep
from hil.ending import Ending
from hil.timing.vitals import Vitals
from hil.verdict import Result
from plant.unit.scenario import load_scenario
from studies.campaigns.memory import table_of

TICKS = 200
APP = typer.Typer()
APP.callback()(lambda: None)
register(APP)
DATABASES = [loader_database()]


@pytest.fixture(scope="module")
def bench():
    """Two seconds of both nodes standing still; the frames, and the scenario they are of."""
    scenario = load_scenario("standstill")
    made = lockstep(scenario, reference=False)
    for _ in range(TICKS):
        made.step()
    return SimpleNamespace(frames=made.recording.bus, scenario=scenario)


@pytest.fixture
def table(bench):
    return table_of(bench.frames)


def rows_of(table, name):
    return np.flatnonzero(table.can_id == loader_database().by_name[name].can_id)


def without(table, rows):
    return table.select(np.setdiff1d(np.arange(len(table)), rows))


def failed(done):
    return {one.verdict.name for one in done.messages if one.verdict.result is Result.FAILED}


def verdict_on(done, name):
    return next(one.verdict for one in done.messages if one.verdict.name == name)


def test_a_lockstep_run_is_in_time(table):
    done = check(table, DATABASES)
    assert done.overall.result is Result.PASSED, done.overall.reason
    cyclic = {codec.name for codec in loader_database().by_name.values() if codec.cycle_ns}
    assert {one.verdict.name for one in done.messages} == cyclic
    assert (done.silent, done.aperiodic, done.unknown, done.notes) == ({}, (), 0, ())


@pytest.mark.parametrize("name", ["Articulation", "NormalForces", "Warnings", "SlopeSensor"])
def test_one_lost_frame_is_found_in_its_message(table, name):
    rows = rows_of(table, name)
    done = check(without(table, rows[len(rows) // 2]), DATABASES)
    assert failed(done) == {name}
    found = verdict_on(done, name)
    assert (found.missing, found.late, found.early, found.duplicates) == (1, 1, 0, 0)
    counted = loader_database().by_name[name].e2e_data_id is not None  # the slope sensor has no counter
    assert (found.counter_jumps, found.lost_frames) == ((1, 1) if counted else (0, 0))
    assert done.overall.result is Result.FAILED
    assert name in done.overall.reason


def test_a_repeated_frame_is_found(table):
    rows = rows_of(table, "Articulation")
    at = int(rows[100])
    order = np.insert(np.arange(len(table)), at + 1, at)
    done = check(table.select(order), DATABASES)
    assert failed(done) == {"Articulation"}
    found = verdict_on(done, "Articulation")
    assert (found.duplicates, found.early, found.counter_jumps) == (1, 1, 0)


def test_a_delayed_frame_is_late_and_the_next_early(table):
    rows = rows_of(table, "Articulation")
    table.time_ns[rows[50]] += 6_000_000
    found = verdict_on(check(table, DATABASES), "Articulation")
    assert (found.late, found.early, found.missing) == (1, 1, 0)


def test_a_message_that_its_node_never_sent_is_missing(table):
    done = check(without(table, rows_of(table, "Limits")), DATABASES)
    assert failed(done) == {"Limits"}
    assert verdict_on(done, "Limits").missing == pytest.approx(TICKS, abs=1)


def test_an_optional_message_may_be_missing_but_not_late(table):
    rows = rows_of(table, "EstimateUncertainty")
    done = check(without(table, rows), DATABASES)
    assert done.overall.result is Result.PASSED, done.overall.reason
    assert "EstimateUncertainty" not in {one.verdict.name for one in done.messages}
    assert failed(check(without(table, rows[8:12]), DATABASES)) == {"EstimateUncertainty"}


def test_a_node_that_is_not_there_leaves_the_question_open_unless_it_does_not_matter(table):
    machine = [c.can_id for c in loader_database().by_name.values() if "Machine" in c.senders]
    alone = without(table, np.flatnonzero(np.isin(table.can_id, machine)))
    done = check(alone, DATABASES)
    assert done.overall.result is Result.INCONCLUSIVE
    assert "Machine sent nothing" in done.overall.reason
    assert done.silent == {"loader": ("Machine",)}
    named = check(alone, DATABASES, Rules(nodes=("EstimatorEcu",)))
    assert named.overall.result is Result.PASSED
    assert check(alone, DATABASES, Rules(nodes=("Machine",))).overall.result is Result.INCONCLUSIVE


def test_a_dbc_of_which_nothing_occurs_does_not_matter(table):
    done = check(table, [*DATABASES, Database.from_file(FOLDER / "reference.dbc")])
    assert done.overall.result is Result.PASSED


def test_damage_between_the_frames_is_doubt_at_the_end_it_is_a_note(table):
    inside = replace(table, damaged=(Damage(7, "no frame"),), damaged_count=1)
    assert check(inside, DATABASES).overall.result is Result.INCONCLUSIVE
    end = Damage(9, "the file ends inside this line", at_end=True)
    done = check(replace(table, damaged=(end,), damaged_count=1), DATABASES)
    assert done.overall.result is Result.PASSED
    assert "line 9" in done.notes[0]


def test_a_starved_host_decides_nothing_only_where_something_was_late(table):
    starved = replace(check(table, DATABASES).observer, starved="12 % stolen")
    assert check(table, DATABASES, observer=starved).overall.result is Result.PASSED
    behind = np.where(table.time_ns > table.time_ns[0] + 200_000_000, 100_000_000, 0)
    waited = replace(table, time_ns=table.time_ns + behind)  # all senders were kept waiting for 0.1 s
    starved = replace(check(waited, DATABASES).observer, starved="12 % stolen")
    late = check(waited, DATABASES, observer=starved)
    assert late.overall.result is Result.INCONCLUSIVE
    assert "12 % stolen" in late.overall.reason


def test_the_same_message_on_two_channels_is_judged_on_each(table):
    """Twice the frames on one wire would be early; a frame lost on one of them is found there."""
    both = np.sort(np.concatenate((np.arange(len(table)), np.arange(len(table)))))
    doubled = replace(
        table.select(both), channel=np.tile(np.uint8([0, 1]), len(table)), channels=("in", "out")
    )
    assert check(doubled, DATABASES).overall.result is Result.PASSED
    gone = np.flatnonzero(
        (doubled.channel == 1) & (doubled.can_id == loader_database().by_name["Limits"].can_id)
    )
    done = check(without(doubled, gone[10]), DATABASES)
    assert [(o.channel, o.verdict.name) for o in done.messages if o.verdict.result is Result.FAILED] == [
        ("out", "Limits")
    ]


def test_two_sources_of_a_j1939_group_are_reported_apart(table, tmp_path):
    dbc = tmp_path / "two.dbc"
    dbc.write_text(GROUP)
    frames = [
        (at, 0x18FEF100 | source | EXTENDED)
        for at in range(0, 2_000_000_000, 100_000_000)
        for source in (3, 9)
    ]
    made = replace(
        table.select(np.arange(len(frames))),
        time_ns=np.array([at for at, _ in frames]),
        can_id=np.array([word for _, word in frames], np.uint32),
    )
    done = check(made, [Database.from_file(dbc)])
    assert [one.verdict.name for one in done.messages] == ["CCVS from 3", "CCVS from 9"]
    assert done.overall.result is Result.PASSED


GROUP = """VERSION ""
NS_ :
BS_:
BU_: Engine
BO_ 2566844675 CCVS: 8 Engine
 SG_ Speed : 8|16@1+ (0.00390625,0) [0|250] "km/h" Vector__XXX
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "VFrameFormat" BO_ 2566844675 3;
BA_ "GenMsgCycleTime" BO_ 2566844675 100;
"""


@pytest.fixture
def log(bench, tmp_path):
    file = tmp_path / "drive.log"
    file.write_text("".join(f"{candump_line(frame, 'can0')}\n" for frame in bench.frames))
    return file


def invoke(*words):
    return CliRunner().invoke(APP, ["check", *map(str, words)])


def test_the_command_passes_and_says_so(log):
    result = invoke(log)
    assert result.exit_code == Ending.PASSED, result.output
    assert "PASSED  every message in time" in result.output
    assert "1.99" in result.output.splitlines()[0] or "2.00" in result.output.splitlines()[0]


def test_the_command_fails_with_the_message_and_speaks_json(log):
    lines = log.read_text().splitlines(keepends=True)
    identifier = f"{loader_database().by_name['Limits'].can_id & ~EXTENDED:08X}#"
    first = next(k for k, line in enumerate(lines) if k > 2000 and identifier in line)
    log.write_text("".join(lines[:first] + lines[first + 1 :]))
    result = invoke(log, "--json")
    assert result.exit_code == Ending.FAILED
    content = json.loads(result.output)
    assert content["overall"]["result"] == "FAILED"
    bad = [one["verdict"] for one in content["messages"] if one["verdict"]["result"] == "FAILED"]
    assert [(v["name"], v["missing"]) for v in bad] == [("Limits", 1)]
    assert invoke(log, "--to-s", "0.4").exit_code == Ending.PASSED  # before the fault


def test_what_cannot_be_judged_is_exit_code_1(log):
    result = invoke(log, "--to-s", "0.02", "--node", "Machine")
    assert result.exit_code == Ending.FAILED
    assert "INCONCLUSIVE" in result.output


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("--node", "Nobody"), "its senders are EstimatorEcu, Machine"),
        (("--channel", "can7"), "no channel 'can7'; there are can0"),
        (("--from-s", "5"), "nothing to judge there; there are"),
    ],
)
def test_a_wrong_option_is_one_clear_error(log, words, named):
    result = invoke(log, *words)
    assert named in str(result.exception)


def test_an_empty_recording_is_reported(tmp_path):
    empty = tmp_path / "empty.log"
    empty.touch()
    result = invoke(empty)
    assert result.exit_code == Ending.FAILED
    assert "empty (0 bytes)" in result.output


@pytest.mark.parametrize(
    ("stolen", "outcome", "expected"),
    [(0.0, "finished", "PASSED"), (0.2, "finished", "PASSED"), (0.0, "running", "cut off")],
)
def test_a_run_directory_brings_its_window_and_its_doubts(bench, log, tmp_path, stolen, outcome, expected):
    """The ECU answers before the plant begins; what counts is the time in which the plant ticked."""
    run = tmp_path / "run"
    record = Choice(scenario=bench.scenario.name).record(bench.scenario, "realtime")
    rundir.begin(run, record)
    shift = "".join(f"{candump_line(f._replace(at_ns=f.at_ns + 10**9), 'loader')}\n" for f in bench.frames)
    stray = f"{candump_line(bench.frames[0]._replace(at_ns=10**6), 'loader')}\n"
    (run / rundir.BUS).write_text(stray + shift)
    due = np.arange(TICKS, dtype=np.int64) * 10_000_000 + 10**9
    rundir.write_table(run / rundir.TIMING, {"plant_due_ns": due, "plant_lateness_ns": due * 0})
    vitals = Vitals(stolen=stolen, worst_stolen=stolen, lives=())
    rundir.write_record(run, replace(record, outcome=outcome, vitals=vitals))
    result = invoke(run)
    assert expected in result.output.splitlines()[-2]  # the last line is the verdict on the frames' content
    assert (result.exit_code == Ending.PASSED) == (expected == "PASSED")
