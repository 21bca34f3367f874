"""Scenarios with faults in lockstep: what was scripted happens, is recorded, and can be repeated."""

import numpy as np
import pytest

from deploy.c.core import C
from ecu.core import PYTHON
from hil import rundir
from hil.compose import Choice, ChoiceError
from hil.faults.passage import Action
from hil.faults.record import read_faults
from hil.faults.restartable import RestartableEcu, RestartablePlant, acting_on
from hil.lockstep import Lockstep
from hil.processes.realtime import run_realtime
from hil.rundir import RunDirectory
from hil.runs import run_lockstep
from report.render import Pictures
from report.run import write_report
from tests.deploy.c.building import compiler
from tests.hil.fakes import FakeEcu, FakePlant

SCENARIO = """
name = "faulty"
sentence = "Straight on, with faults."
duration_s = 2.0
machine = "l60"
seed = 1

[start]
speed_kmh = 8.0

[driver.speed_kmh]
points = [[0.0, 8.0]]
"""
GYRO_DIES = """
[[fault]]
kind = "drop"
message = "BodyRates"
at_s = 0.8
for_s = 0.5
"""
ECU_DIES = """
[[fault]]
kind = "kill"
process = "ecu"
at_s = 0.8
for_s = 0.6
"""
RUNNING, DEGRADED, SAFE_VALUES = 1, 2, 3


@pytest.fixture(params=[PYTHON, C], ids=["python", "c"])
def run(tmp_path, request):
    """Runs the scenario with each core of the ECU: what is promised of a run holds for both."""
    compiler()

    def run(scenario_faults="", inject="", name="run"):
        file = tmp_path / "faulty.toml"
        file.write_text(SCENARIO + scenario_faults)
        more = tmp_path / "more.toml"
        more.write_text(inject)
        choice = Choice(scenario=str(file), inject=more if inject else None, core=request.param)
        run_lockstep(choice, tmp_path / name)
        return RunDirectory.read(tmp_path / name)

    return run


def test_a_scripted_fault_degrades_the_ecu_while_it_lasts(run):
    seen = run(GYRO_DIES)
    status = seen.messages["EcuStatus"]
    degraded = status.time_s[status.signals["State"] == DEGRADED]
    during = degraded[degraded > 0.5]
    assert 0.8 < during[0] < 0.86
    assert 1.28 < during[-1] < 1.31
    rates = seen.messages["BodyRates"].time_s
    assert not np.any((rates > 0.801) & (rates < 1.3))


def test_what_was_injected_is_recorded(run):
    (entry,) = read_faults(run(GYRO_DIES).path)
    assert (entry.fault, entry.began_s, entry.ended_s, entry.struck) == ("drop BodyRates", 0.8, 1.3, 50)


def test_a_fault_that_lasts_ends_with_the_run(run):
    (entry,) = read_faults(run('[[fault]]\nkind = "drop"\nmessage = "BodyRates"\nat_s = 1.0\n').path)
    assert entry.ended_s == pytest.approx(2.01)
    assert entry.struck == 101


def test_faults_can_come_from_a_file_of_their_own(run):
    entries = read_faults(run(GYRO_DIES, inject='[[fault]]\nkind = "corrupt"\nprobability = 0.01\n').path)
    assert [t.fault for t in entries] == ["corrupt probability=0.01", "drop BodyRates"]


def test_two_runs_are_equal_to_the_byte(run):
    noise = '[[fault]]\nkind = "corrupt"\nprobability = 0.1\n[[fault]]\nkind = "jitter"\njitter_ms = 4.0\n'
    one, two = run(noise, name="one"), run(noise, name="two")
    assert (one.path / rundir.BUS).read_bytes() == (two.path / rundir.BUS).read_bytes()


def test_the_machine_of_a_dead_ecu_falls_back_and_the_new_ecu_takes_over(run):
    seen = run(ECU_DIES)
    limits = seen.messages["Limits"]
    assert not np.any((limits.time_s > 0.81) & (limits.time_s < 1.4))
    status = seen.messages["EcuStatus"]
    assert set(status.signals["State"][status.time_s > 1.9]) == {1}


def test_the_faults_of_an_earlier_run_are_removed(run):
    assert read_faults(run(GYRO_DIES).path)
    assert read_faults(run().path) == []


def test_the_report_lists_what_was_injected(run, tmp_path, monkeypatch):
    monkeypatch.setattr("report.run.section.pictures_of", lambda *_: Pictures())
    page = write_report([run(GYRO_DIES).path], tmp_path / "report.html").read_text()
    assert "Injected faults" in page
    assert "drop BodyRates" in page


def test_in_real_time_faults_are_refused_rather_than_left_out(tmp_path):
    file = tmp_path / "faulty.toml"
    file.write_text(SCENARIO + GYRO_DIES)
    with pytest.raises(ChoiceError, match=r"faulty\.toml: has faults to inject"):
        run_realtime(Choice(scenario=str(file)), tmp_path / "run")


def test_a_dead_side_says_and_hears_nothing_until_it_is_restarted():
    made = []

    def make():
        made.append(FakeEcu())
        return made[-1]

    inner = FakePlant(30)
    plant, ecu = RestartablePlant(inner), RestartableEcu(make)
    act, bench = acting_on(plant, ecu), Lockstep(plant, ecu)
    for _ in range(10):
        bench.step()
    act(Action("kill", "ecu"), 0)
    for _ in range(10):
        bench.step()
    assert len(made[0].ticked) == 10
    assert len(inner.heard) == 10
    act(Action("restart", "ecu"), 0)
    act(Action("kill", "plant"), 0)
    bench.run()
    assert len(made) == 2
    assert len(made[1].ticked) == 10
    assert made[1].heard == []
    assert len(inner.ticked) == 30


@pytest.mark.parametrize("offset", [-9.81, -9.0])
def test_a_sensor_without_gravity_is_found_and_left_out_until_it_is_back(run, offset):
    """Once it left the ECU in FAULT for good (-9.81), or was believed (-9.0)."""
    fault = f"""
[[fault]]
kind = "offset"
message = "BodyAcceleration"
signal = "Vertical"
offset = {offset}
at_s = 0.8
for_s = 0.6
"""
    with_fault = run(inject=fault)
    status = with_fault.messages["EcuStatus"]
    states = status.signals["State"]
    assert np.all(states[(status.time_s > 0.85) & (status.time_s < 1.4)] == DEGRADED)
    assert states[-1] == RUNNING
    loads = with_fault.messages["NormalForces"]
    front = loads.signals["FrontLeft"]
    before, during = front[loads.time_s < 0.8][-1], front[(loads.time_s > 0.85) & (loads.time_s < 1.4)]
    valid = loads.signals["FrontLeftValid"][(loads.time_s > 0.85) & (loads.time_s < 1.4)] > 0
    # a load that is marked valid is one: a driver's torque changes it by a few percent meanwhile
    assert np.all(np.abs(during[valid] / before - 1.0) < 0.1)
