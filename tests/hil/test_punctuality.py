"""A real-time run is judged on each of its buses: what is late there is told, what cannot be judged never passes."""

import json
from dataclasses import replace

import numpy as np
import pytest

from dbc import loader_database
from dbc.writer import candump_line
from hil import rundir
from hil.compose import lockstep, record_of
from hil.console import punctual
from hil.faults.record import Injected, write_faults
from hil.recording.observed import ECU_BUS, PLANT_BUS, punctuality_of
from hil.rundir import RunDirectory
from hil.verdict import Result
from hil.vitals import Life, Vitals
from plant.scenario import load_scenario

TICKS = 200
PERIOD = 10_000_000
START = 10**9


def vitals(*, stolen=0.0, waited=0.001, worst=0.01):
    """Of an ECU that waited for a processor for a share of the time, and in its worst second."""
    ecu = Life(
        process="ecu", pid=1, seconds=2.0, start_bytes=2**27, settled_bytes=None, end_bytes=2**27,
        largest_bytes=2**27, waited=waited, worst_waited=worst,
    )  # fmt: skip
    return Vitals(stolen=stolen, worst_stolen=stolen, lives=(ecu,))


@pytest.fixture(scope="module")
def frames():
    """Two seconds of both nodes standing still, from second 1 of the bus clock."""
    made = lockstep(load_scenario("standstill"), reference=False)
    for _ in range(TICKS):
        made.step()
    return [frame._replace(at_ns=frame.at_ns + START) for frame in made.recording.bus]


@pytest.fixture
def run(frames, tmp_path):
    """A real-time run that kept its times, over a gateway."""
    path = tmp_path / "run"
    record = record_of(load_scenario("standstill"), form="corrected", limits=True, mode="realtime")
    rundir.begin(path, record)
    write(path / rundir.BUS, frames)
    write(path / rundir.ECU_BUS, [frame._replace(at_ns=frame.at_ns + 200_000) for frame in frames])
    due = START + PERIOD * np.arange(TICKS, dtype=np.int64)
    times = {
        f"{who}_{what}_ns": np.full(TICKS, 10**5)
        for who in ("plant", "ecu")
        for what in ("lateness", "execution")
    }
    rundir.write_table(path / rundir.TIMING, {"plant_due_ns": due} | times)
    rundir.write_record(path, replace(record, outcome="finished", vitals=vitals()))
    return path


def write(file, frames):
    file.write_text("".join(f"{candump_line(frame, 'loader')}\n" for frame in frames))


def judged(path):
    return punctuality_of(RunDirectory.read(path))


def change(path, **fields):
    rundir.write_record(path, replace(rundir.read_record(path), **fields))


def without_some(frames, name):
    """Ten frames of a message are gone."""
    rows = [i for i, frame in enumerate(frames) if frame.can_id == loader_database().by_name[name].can_id]
    gone = set(rows[50:60])
    return [frame for i, frame in enumerate(frames) if i not in gone]


def test_a_run_in_time_passes_on_both_buses(run):
    kept = judged(run)
    assert kept.frames.result is Result.PASSED, kept.frames.reason
    assert {message.channel for message in kept.messages} == {PLANT_BUS, ECU_BUS}
    assert {task.name: task.result for task in kept.tasks} == {"plant": Result.PASSED, "ecu": Result.PASSED}


def test_frames_lost_behind_the_gateway_fail_there_and_are_named(run, frames):
    write(run / rundir.ECU_BUS, without_some(frames, "Articulation"))
    kept = judged(run)
    assert kept.frames.result is Result.FAILED
    assert kept.frames.reason.startswith(f"{ECU_BUS}: Articulation: 10 missing")
    late = [(one.channel, one.verdict.name) for one in kept.messages if one.verdict.events]
    assert late == [(ECU_BUS, "Articulation")]


def test_injected_faults_may_be_why_so_it_cannot_be_told(run, frames):
    write(run / rundir.ECU_BUS, without_some(frames, "Articulation"))
    write_faults(run, [Injected(1, "drop Articulation", 0.5, 0.6, 0)])
    assert judged(run).frames.result is Result.FAILED  # it struck nothing
    write_faults(run, [Injected(1, "drop Articulation", 0.5, 0.6, 10)])
    frames_verdict = judged(run).frames
    assert frames_verdict.result is Result.INCONCLUSIVE
    assert "Articulation: 10 missing" in frames_verdict.reason


@pytest.mark.parametrize(
    ("fields", "named"),
    [
        ({"vitals": vitals(waited=0.2)}, "ecu waited 20.0 % of the time for a processor"),
        ({"vitals": vitals(stolen=0.2)}, "20.0 % of the time the processors went to other guests"),
        ({"statistics": {"ecu-recorder_dropped": 3}}, "lost 3 frames"),
        ({"outcome": "failed"}, "cut off"),
        ({"vitals": None}, "nobody watched"),
    ],
)
def test_what_could_not_be_judged_does_not_pass(run, fields, named):
    change(run, **fields)
    kept = judged(run)
    assert kept.frames.result is Result.INCONCLUSIVE
    assert named in kept.frames.reason


def test_a_starved_second_explains_what_was_late_and_does_not_doubt_what_was_not(run, frames):
    change(run, vitals=vitals(worst=0.4))
    assert judged(run).frames.result is Result.PASSED
    write(run / rundir.ECU_BUS, without_some(frames, "Articulation"))
    kept = judged(run)
    assert kept.frames.result is Result.INCONCLUSIVE
    assert "10 missing" in kept.frames.reason
    assert "ecu waited 40.0 % of its worst second" in kept.frames.reason


def test_a_bus_that_was_not_recorded_does_not_pass(run):
    (run / rundir.BUS).write_text("")
    kept = judged(run)
    assert kept.frames.result is Result.INCONCLUSIVE
    assert "bus.log" in kept.frames.reason


def test_it_stands_in_the_record_and_is_read_back(run):
    kept = judged(run)
    change(run, punctuality=kept)
    back = RunDirectory.read(run)
    assert back.record.punctuality == kept
    assert punctual(back) == [kept.frames, kept.ticks]
    plain = json.loads((run / rundir.RECORD).read_text(), parse_constant=pytest.fail)  # no NaN
    assert plain["punctuality"]["frames"]["result"] == "PASSED"
