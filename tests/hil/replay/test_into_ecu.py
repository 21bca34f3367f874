"""A recording through the ECU's core: equal bit for bit, on the virtual clock and with a host's jitter; one bit is found."""

from dataclasses import replace

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from bus.frame import Frame
from dbc import loader_database
from dbc.errors import LogError
from dbc.recordings.writer import candump_line
from hil import rundir
from hil.compose import Choice, lockstep, plant_unit
from hil.ecu_side import ecu_cycle
from hil.ending import Ending
from hil.replay.command import register
from hil.replay.into_ecu import into_ecu
from hil.runs import run_lockstep
from plant.unit.scenario import load_scenario
from studies.campaigns.memory import table_of

MS = 1_000_000
TICKS = 150
DATABASE = loader_database()
APP = typer.Typer()
APP.callback()(lambda: None)
register(APP)


def fresh():
    return ecu_cycle(form="corrected", limits=True)


def row_of(frames, name, number):
    return [k for k, frame in enumerate(frames) if frame.can_id == DATABASE.by_name[name].can_id][number]


def changed(frames, row, byte, bits):
    data = bytearray(frames[row].data)
    data[byte] ^= bits
    return [*frames[:row], frames[row]._replace(data=bytes(data)), *frames[row + 1 :]]


@pytest.fixture(scope="module")
def scenario():
    return load_scenario("abrupt_articulation")


@pytest.fixture(scope="module")
def virtual(scenario):
    """The bus of a lockstep run."""
    bench = lockstep(scenario, reference=False)
    for _ in range(TICKS):
        bench.step()
    return bench.recording.bus


def realtime(scenario, seed, lateness_ms, idle):
    """A bus as a busy host makes it: ticks late, some skipped, and frames of the machine between the ECU's answers."""
    rng = np.random.default_rng(seed)
    plant, core = plant_unit(scenario), fresh()
    start = due = 10**12
    bus, on_the_way = [], []
    sampled = execution = 0
    for tick in range(idle + TICKS):
        if tick > idle + 20 and rng.random() < 0.05:
            core.overran(1)
            due += 10 * MS
        begun = due + int(rng.uniform(0.05, lateness_ms) * MS)
        while start + (idle + sampled) * 10 * MS <= begun:
            at = start + (idle + sampled) * 10 * MS
            for frame in plant.tick(sampled * 10 * MS):
                at += int(rng.uniform(5, 20)) * 1000
                on_the_way.append(frame._replace(at_ns=at))
            sampled += 1
        heard = [frame for frame in on_the_way if frame.at_ns <= begun]
        on_the_way = on_the_way[len(heard) :]
        for frame in heard:
            core.receive(frame, frame.at_ns)
        core.executed(execution)
        at = begun + int(rng.uniform(0.05, 0.08) * MS)
        answers = []
        for frame in core.tick(due).frames:
            at += 5_000
            answers.append(frame._replace(at_ns=at))
            plant.receive(frame, at)
        execution = (at - begun) // 2000 * 2000
        bus += [*heard, *answers]
        due += 10 * MS
    return sorted(bus, key=lambda frame: frame.at_ns)


def test_a_lockstep_run_gives_the_recorded_answers(virtual):
    found = into_ecu(table_of(virtual), fresh, DATABASE)
    assert found.difference is None, str(found.difference)
    assert found.ticks == TICKS
    mine = {codec.can_id for codec in DATABASE.by_name.values() if "EstimatorEcu" in codec.senders}
    assert found.answers == sum(1 for frame in virtual if frame.can_id in mine)


@pytest.mark.parametrize("name", ["NormalForces", "Limits", "EcuStatus", "StabilityControl"])
def test_a_single_bit_in_an_answer_is_found_where_it_is(virtual, name):
    row = row_of(virtual, name, 9)
    codec = DATABASE.by_name[name]
    frames = changed(virtual, row, 1 if name == "StabilityControl" else 3, 0x01)
    found = into_ecu(table_of(frames), fresh, DATABASE)
    difference = found.difference
    assert difference is not None
    assert (difference.row, difference.message) == (row, name)
    assert difference.at_s == pytest.approx((virtual[row].at_ns - virtual[0].at_ns) * 1e-9)
    theirs, ours = (
        dict(zip(codec.signals, codec.decode(side[row].data), strict=True))[difference.signal]
        for side in (frames, virtual)
    )
    assert theirs != ours
    assert (difference.recorded, difference.replayed) == (f"{theirs:g}", f"{ours:g}")


def test_another_ecu_is_found_at_its_first_answer(virtual):
    found = into_ecu(table_of(virtual), lambda: ecu_cycle(form="corrected", limits=False), DATABASE)
    assert found.difference is not None
    assert found.difference.message == "Limits"
    assert found.ticks == 0


def test_a_lost_answer_is_found(virtual):
    row = row_of(virtual, "RollOver", 20)
    found = into_ecu(table_of([*virtual[:row], *virtual[row + 1 :]]), fresh, DATABASE)
    assert found.difference is not None
    assert found.ticks == 20


def test_a_recording_without_an_optional_message_gives_the_recorded_answers(virtual):
    """As one that was made before that message existed; one that has it has to have all of its frames."""
    optional = DATABASE.by_name["EstimateUncertainty"].can_id
    older = [frame for frame in virtual if frame.can_id != optional]
    found = into_ecu(table_of(older), fresh, DATABASE)
    assert found.difference is None
    assert found.answers == sum(
        1 for frame in older if "EstimatorEcu" in DATABASE.by_id[frame.can_id].senders
    )
    row = row_of(virtual, "EstimateUncertainty", 5)
    assert into_ecu(table_of([*virtual[:row], *virtual[row + 1 :]]), fresh, DATABASE).difference is not None


def test_an_input_that_changed_shows_in_the_answers(virtual):
    """The plausible change of one frame: with its CRC wrong the ECU does not use it, and says so."""
    row = row_of(virtual, "BodyAcceleration", 40)
    found = into_ecu(table_of(changed(virtual, row, 4, 0x10)), fresh, DATABASE)
    assert found.difference is not None
    assert found.ticks >= 40


@pytest.mark.parametrize(("seed", "lateness_ms", "idle"), [(1, 0.3, 0), (2, 2.0, 40), (3, 9.7, 7)])
def test_a_run_in_real_time_gives_the_recorded_answers(scenario, seed, lateness_ms, idle):
    frames = realtime(scenario, seed, lateness_ms, idle)
    found = into_ecu(table_of(frames), fresh, DATABASE)
    assert found.difference is None, f"after {found.ticks} ticks: {found.difference}"
    assert found.ticks >= idle + TICKS - 1


def test_a_recording_that_begins_too_late_is_refused(virtual):
    with pytest.raises(LogError, match="already running"):
        into_ecu(table_of(virtual[1000:]), fresh, DATABASE, "late.log")
    with pytest.raises(LogError, match="not one frame of EstimatorEcu"):
        into_ecu(table_of([Frame(0x123, b"")]), fresh, DATABASE)
    lost = [frame for k, frame in enumerate(virtual) if k % 7]
    with pytest.raises(LogError, match="fit no tick"):
        into_ecu(table_of(lost[:60]), fresh, DATABASE)


def test_a_run_that_tested_its_sensors_gives_the_recorded_answers(tmp_path):
    """A shifted wheel speed is dropped by the detection: the ECU without it answers otherwise."""
    fault = tmp_path / "shifted.toml"
    fault.write_text(
        '[[fault]]\nkind = "offset"\nmessage = "WheelSpeedsFront"\nsignal = "Left"\noffset = 1.0\nat_s = 1.0\n',
        encoding="utf-8",
    )
    choice = Choice(scenario="loaded", changes=("duration_s=1.5",), inject=fault, detect_faults=True)
    assert run_lockstep(choice, tmp_path / "run").record.detect_faults
    result = CliRunner().invoke(APP, ["replay", str(tmp_path / "run"), "--into-ecu"])
    assert result.exit_code == Ending.PASSED, result.output
    record = rundir.read_record(tmp_path / "run")
    rundir.write_record(tmp_path / "run", replace(record, detect_faults=False))
    result = CliRunner().invoke(APP, ["replay", str(tmp_path / "run"), "--into-ecu"])
    assert result.exit_code != Ending.PASSED


def test_the_command_says_so_in_a_line(virtual, scenario, tmp_path):
    run = tmp_path / "run"
    rundir.begin(run, Choice(scenario=scenario.name).record(scenario, "lockstep"))
    log = run / rundir.BUS
    log.write_text("".join(f"{candump_line(frame, 'loader')}\n" for frame in virtual))
    result = CliRunner().invoke(APP, ["replay", str(run), "--into-ecu"])
    assert result.exit_code == Ending.PASSED, result.output
    assert f"answers of {TICKS} ticks equal bit for bit" in result.output
    result = CliRunner().invoke(APP, ["replay", str(log), "--into-ecu", "--no-limits"])
    assert result.exit_code == Ending.FAILED
    assert "Limits.FrontLeftTorque: " in result.output
    assert "kN.m recorded" in result.output
    for words, named in (
        (["--into-ecu", "--form", "guessed"], "not one of corrected, printed"),
        ([], "or --into-ecu"),
    ):
        assert named in str(CliRunner().invoke(APP, ["replay", str(log), *words]).exception)
