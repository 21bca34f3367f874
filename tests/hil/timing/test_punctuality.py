"""A real-time run is judged on each of its buses: what is late there is reported, what cannot be judged never passes."""

import json
from dataclasses import replace

import numpy as np
import pytest

from dbc import loader_database
from dbc.recordings.writer import candump_line
from hil import rundir
from hil.check.command import as_json
from hil.check.observed import ECU_BUS, PLANT_BUS, check_observed, observed, punctuality_of
from hil.compose import Choice, lockstep
from hil.ending import Ending
from hil.faults.record import Injected, write_faults
from hil.rundir import RunDirectory
from hil.runs import RunResult
from hil.timing.vitals import Life, Vitals
from hil.verdict import Result
from plant.unit.scenario import load_scenario
from testbench.conclusion import conclude, timing_verdicts

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
    record = Choice(scenario="standstill").record(load_scenario("standstill"), "realtime")
    rundir.begin(path, record)
    write(path / rundir.BUS, frames)
    write(path / rundir.ECU_BUS, [frame._replace(at_ns=frame.at_ns + 200_000) for frame in frames])
    due = START + PERIOD * np.arange(TICKS, dtype=np.int64)
    times = {
        f"{who}_{what}_ns": np.full(TICKS, 10**5)
        for who in ("plant", "ecu")
        for what in ("lateness", "execution")
    }
    rundir.write_table(path / rundir.TIMING, {"plant_due_ns": due, "ecu_due_ns": due} | times)
    rundir.write_record(path, replace(record, outcome="finished", vitals=vitals()))
    return path


def write(file, frames):
    file.write_text("".join(f"{candump_line(frame, 'loader')}\n" for frame in frames))


def judged(path):
    return punctuality_of(RunDirectory.read(path))


def change(path, **fields):
    rundir.write_record(path, replace(rundir.read_record(path), **fields))


def without_some(frames, name, count=10):
    """Some frames of a message are gone."""
    rows = [i for i, frame in enumerate(frames) if frame.can_id == loader_database().by_name[name].can_id]
    gone = set(rows[50 : 50 + count])
    return [frame for i, frame in enumerate(frames) if i not in gone]


def paused(frames, name):
    """As if the sender of a message had been kept waiting for a turn of its counter: no frame is lacking by the counter."""
    return without_some(frames, name, 15)


def test_a_run_in_time_passes_on_both_buses(run):
    kept = judged(run)
    assert kept.frames.result is Result.PASSED, kept.frames.reason
    assert {message.channel for message in kept.messages} == {PLANT_BUS, ECU_BUS}
    assert {task.name: task.result for task in kept.tasks} == {"plant": Result.PASSED, "ecu": Result.PASSED}


def test_the_check_of_a_real_time_run_is_written_as_json(run, frames):
    late_plant(run, frames, waits={"plant": [(START, START + 5_000_000, 5_000_000)]})
    done = check_observed(observed(run), [loader_database()])
    assert done.observer.waits
    content = json.loads(as_json(run, done))
    assert {message["verdict"]["result"] for message in content["messages"]} <= {r.value for r in Result}
    assert "waits" not in content["observer"]


def test_frames_lost_behind_the_gateway_fail_there_and_are_named(run, frames):
    write(run / rundir.ECU_BUS, without_some(frames, "Articulation"))
    kept = judged(run)
    assert kept.frames.result is Result.FAILED
    assert kept.frames.reason.startswith(f"{ECU_BUS}: Articulation: 10 missing")
    late = [(one.channel, one.verdict.name) for one in kept.messages if one.verdict.events]
    assert late == [(ECU_BUS, "Articulation")]


def test_injected_faults_may_be_why_so_it_is_inconclusive(run, frames):
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
        ({"statistics": {"ecu-recorder_dropped": 3}}, "lost 3 frames"),
        ({"outcome": "failed"}, "cut off"),
    ],
)
def test_what_could_not_be_judged_does_not_pass(run, fields, named):
    change(run, **fields)
    kept = judged(run)
    assert kept.frames.result is Result.INCONCLUSIVE
    assert named in kept.frames.reason


@pytest.mark.parametrize(
    ("fields", "named"),
    [
        ({"vitals": vitals(waited=0.2)}, "ecu waited 20.0 % of the time for a processor"),
        ({"vitals": vitals(stolen=0.2)}, "20.0 % of the time the processors went to other guests"),
        ({"vitals": None}, "was not measured"),
    ],
)
def test_a_starved_host_excuses_only_what_was_late(run, frames, fields, named):
    change(run, **fields)
    assert judged(run).frames.result is Result.PASSED
    write(run / rundir.ECU_BUS, paused(frames, "Articulation"))
    kept = judged(run)
    assert kept.frames.result is Result.INCONCLUSIVE
    assert named in kept.frames.reason


def test_a_starved_host_loses_no_frame_that_nobody_counted(run, frames):
    change(run, vitals=vitals(waited=0.2, worst=0.4))
    write(run / rundir.ECU_BUS, without_some(frames, "Articulation"))
    assert judged(run).frames.result is Result.FAILED
    change(run, statistics={"gateway_dropped": 10})
    assert judged(run).frames.result is Result.INCONCLUSIVE


def test_a_starved_second_explains_what_was_late_and_does_not_doubt_what_was_not(run, frames):
    change(run, vitals=vitals(worst=0.4))
    assert judged(run).frames.result is Result.PASSED
    write(run / rundir.ECU_BUS, paused(frames, "Articulation"))
    kept = judged(run)
    assert kept.frames.result is Result.INCONCLUSIVE
    assert "15 missing" in kept.frames.reason
    assert "ecu waited 40.0 % of its worst second" in kept.frames.reason


LATE = 80
"""The tick that is late."""


def late_plant(run, frames, *, skipped=0, late_ms=8.0, took_ms=0.1, waits=None):
    """The plant's tick LATE starts late or takes long, on the bus too; others are left out before it."""
    due = START + PERIOD * np.delete(np.arange(TICKS, dtype=np.int64), np.arange(LATE - skipped, LATE))
    lateness, execution = np.full(due.size, 10**5), np.full(due.size, 10**5)
    lateness[LATE - skipped], execution[LATE - skipped] = round(late_ms * 1e6), round(took_ms * 1e6)
    ecu = dict.fromkeys(("ecu_lateness_ns", "ecu_execution_ns"), np.full(TICKS, 10**5))
    plant = {"plant_due_ns": due, "plant_lateness_ns": lateness, "plant_execution_ns": execution}
    looks = {f"waits_{name}": np.array(rows, np.int64) for name, rows in (waits or {}).items()}
    all_due = START + PERIOD * np.arange(TICKS, dtype=np.int64)
    rundir.write_table(run / rundir.TIMING, {**plant, **ecu, "ecu_due_ns": all_due, **looks})
    change(run, statistics={"plant_missed": skipped})
    begin, delay = START + PERIOD * LATE, round((late_ms + took_ms) * 1e6)
    senders = {codec.can_id: codec.senders for codec in loader_database().by_name.values()}

    def stamped(frame):
        mine = begin - skipped * PERIOD <= frame.at_ns < begin + PERIOD and "Machine" in senders[frame.can_id]
        return frame._replace(at_ns=max(frame.at_ns, begin + delay)) if mine else frame

    bus = sorted(map(stamped, frames), key=lambda frame: frame.at_ns)
    write(run / rundir.BUS, bus)
    write(run / rundir.ECU_BUS, [frame._replace(at_ns=frame.at_ns + 200_000) for frame in bus])


def look(waited_ms, tick=LATE, until_ms=12.0):
    """Of a tick, from the end of the tick before."""
    begin = START + PERIOD * tick
    return [[begin - PERIOD + 200_000, begin + round(until_ms * 1e6), round(waited_ms * 1e6)]]


@pytest.mark.parametrize("late", [{"late_ms": 8.0}, {"took_ms": 9.0, "late_ms": 0.1}])
def test_a_late_tick_is_the_hosts_by_a_single_wait_and_the_softwares_without(run, frames, late):
    """A plant that waited, or computed, 8 ms once in a run whose worst second is good: 2 of 200 ticks may be so, one may not."""
    for waits, expected in (
        (None, Result.FAILED),
        ({"plant": look(8.0)}, Result.INCONCLUSIVE),
        ({"plant-hub": look(8.0)}, Result.INCONCLUSIVE),
        ({"ecu": look(8.0)}, Result.FAILED),  # it sends none of these frames
        ({"recorder": look(8.0)}, Result.FAILED),  # they are stamped before they come to it
        ({"plant": look(1.5)}, Result.FAILED),
        ({"plant": look(8.0, tick=LATE - 5)}, Result.FAILED),
    ):
        late_plant(run, frames, **late, waits=waits)
        verdict = judged(run).frames
        assert verdict.result is expected, (waits, verdict.reason)
        assert ("was kept waiting 8.0 ms at 0.81 s" in verdict.reason) == (expected is not Result.FAILED)


def test_skipped_ticks_are_the_hosts_by_a_single_wait_and_the_softwares_without(run, frames):
    """Of three ticks left out, a wait explains what is one and the same delay of 33 ms; what is counted beyond it stays."""
    for waits, expected in (
        (None, Result.FAILED),
        ({"plant": look(28.0, LATE - 3, 40.0)}, Result.INCONCLUSIVE),
        ({"plant": look(27.9, LATE - 3, 40.0)}, Result.FAILED),
        ({"hub": look(40.0, LATE - 3, 40.0)}, Result.FAILED),  # a hub makes no tick late
    ):
        late_plant(run, frames, skipped=3, late_ms=3.0, waits=waits)
        kept = judged(run)
        assert kept.ticks.result is expected, (waits, kept.ticks.reason)
        plant = next(task for task in kept.tasks if task.name == "plant")
        assert plant.result is expected
        for reason in (kept.ticks.reason, plant.reason):
            assert "skipped 3 ticks" in reason
            assert ("plant was kept waiting 28.0 ms at 0.81 s" in reason) == (expected is not Result.FAILED)
    late_plant(run, frames, skipped=3, late_ms=3.0, waits={"plant": look(28.0, LATE - 3, 40.0)})
    change(run, statistics={"plant_missed": 4})
    assert judged(run).ticks.result is Result.FAILED


def test_a_process_that_always_computes_too_long_fails_whatever_it_waited_once(run, frames):
    due = START + PERIOD * np.arange(TICKS, dtype=np.int64)
    times = {
        f"{who}_{what}_ns": np.full(TICKS, 10**5)
        for who in ("plant", "ecu")
        for what in ("lateness", "execution")
    }
    times["plant_execution_ns"][50:60] = 6 * 10**6
    write_waits = {"waits_plant": np.array(look(9.0, tick=55), np.int64)}
    rundir.write_table(run / rundir.TIMING, {"plant_due_ns": due, "ecu_due_ns": due, **times, **write_waits})
    verdict = judged(run).ticks
    assert verdict.result is Result.FAILED
    assert "plant takes too long: p99 6.00 ms" in verdict.reason
    rows = [look(2.0, tick=tick, until_ms=8.0)[0] for tick in range(50, 60)]
    rundir.write_table(
        run / rundir.TIMING,
        {"plant_due_ns": due, "ecu_due_ns": due, **times, "waits_plant": np.array(rows, np.int64)},
    )
    assert judged(run).ticks.result is Result.INCONCLUSIVE


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
    assert timing_verdicts(back) == [kept.frames, kept.ticks]
    plain = json.loads((run / rundir.RECORD).read_text(), parse_constant=pytest.fail)  # no NaN
    assert plain["punctuality"]["frames"]["result"] == "PASSED"


@pytest.mark.parametrize(("most_busy", "result"), [(0.6, Result.FAILED), (1.0, Result.INCONCLUSIVE)])
def test_a_silence_of_a_process_beside_the_bench_is_open_where_no_processor_was_idle(
    run, frames, most_busy, result
):
    """Our own processes waited 0.01 s; that of the foreign ECU is not ours, and may have waited for all of a second."""
    ours = {codec.can_id for codec in loader_database().by_name.values() if "EstimatorEcu" in codec.senders}
    silent = [f for f in frames if f.can_id not in ours or not 0.5e9 < f.at_ns - START < 1.1e9]
    write(run / rundir.BUS, silent)
    change(
        run,
        duration_s=2.0,
        foreign={"ecu": "hub:/tmp/some.hub"},
        vitals=replace(vitals(), most_busy=most_busy),
    )
    concluded = conclude(
        "run", Choice(scenario="standstill"), run, RunResult(Ending.PASSED, "", rundir.read_record(run))
    )
    (verdict,) = [v for v in concluded.verdicts if v.question == "EstimatorEcu is there throughout"]
    assert verdict.result is result, verdict
