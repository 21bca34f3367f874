"""The real plant and the real ECU in lockstep: reproducible to the byte, and the demo's story holds."""

import re
import resource
from pathlib import Path

import numpy as np
import pytest

from configuration import ConfigurationError
from deploy.c.core import C
from ecu.core import PYTHON
from hil import rundir
from hil.compose import Choice, ChoiceError, lockstep
from hil.ending import Ending
from hil.judgement import judge_run
from hil.rundir import RunDirectory, RunError
from hil.runs import run_lockstep
from tests.deploy.c.building import compiler

FILES = (rundir.BUS, rundir.REFERENCE, rundir.TRUTH)
SCENARIO = """
name = "turn"
sentence = "A gentle turn."
duration_s = 2.0
machine = "l60"
seed = 1

[start]
speed_kmh = 8.0

[driver.speed_kmh]
points = [[0.0, 8.0]]

[driver.articulation_deg]
points = [[0.5, 0.0], [1.5, 15.0]]
"""


@pytest.fixture
def turn(tmp_path):
    file = tmp_path / "turn.toml"
    file.write_text(SCENARIO)
    return str(file)


@pytest.fixture(params=["python", "c"])
def core(request):
    """What computes the ECU: the bench does not depend on it."""
    if request.param == "python":
        return PYTHON
    compiler()
    return C


def bytes_of(folder: Path):
    with np.load(folder / rundir.TRUTH) as truth:
        columns = {name: truth[name].tobytes() for name in truth.files}
    return (folder / rundir.BUS).read_bytes(), (folder / rundir.REFERENCE).read_bytes(), columns


def test_two_runs_are_equal_to_the_byte_and_another_seed_is_not(turn, tmp_path, core):
    for name, seed in (("one", 7), ("two", 7), ("other", 8)):
        assert (
            run_lockstep(Choice(scenario=turn, core=core, seed=seed), tmp_path / name).ending is Ending.PASSED
        )
    assert bytes_of(tmp_path / "one") == bytes_of(tmp_path / "two")
    assert bytes_of(tmp_path / "one")[0] != bytes_of(tmp_path / "other")[0]


def test_a_lockstep_run_is_complete(turn, tmp_path, core):
    run_lockstep(Choice(scenario=turn, core=core, payload_kg=500.0), tmp_path / "run")
    run = RunDirectory.read(tmp_path / "run")
    assert run.problems == ()
    assert (run.record.payload_kg, run.record.outcome, run.record.mode) == (500.0, "finished", "lockstep")
    assert run.truth["time_s"] == pytest.approx(0.01 * np.arange(201))
    assert run.truth["payload_mass"] == pytest.approx(500.0)
    assert len(run.messages["Articulation"].time_s) == len(run.truth["time_s"])
    assert {"NormalForces", "RollOver", "Limits", "EcuStatus", "Warnings"} <= set(run.messages)


def test_what_the_ecu_hears_is_what_was_true_a_moment_before(turn, tmp_path, core):
    run_lockstep(Choice(scenario=turn, core=core), tmp_path / "run")
    run = RunDirectory.read(tmp_path / "run")
    heard = run.messages["Articulation"]
    true_deg = np.degrees(np.interp(heard.time_s, run.truth["time_s"], run.truth["articulation_angle"]))
    assert heard.signals["ArticulationAngle"] == pytest.approx(true_deg, abs=1.0)
    assert np.ptp(true_deg) > 10


def test_limits_decide_whether_the_abrupt_turn_rolls_over(tmp_path):
    """The demo in lockstep: announced without limits, prevented with them."""
    seen = {}
    for limits in (False, True):
        out = tmp_path / str(limits)
        run_lockstep(Choice(scenario="abrupt_articulation", limits=limits), out)
        seen[limits] = judge_run(RunDirectory.read(out))
    assert seen[False].rolled_over
    assert seen[False].warned_in_time
    assert not seen[True].lifted
    assert not seen[True].rolled_over


def test_a_full_disk_costs_only_what_does_not_fit(turn, tmp_path):
    """A limit on the size of files stands in for the disk: truth and bus log are larger, the record is not."""
    lockstep(Choice(scenario=turn).load()).step()  # what is compiled is written elsewhere
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, hard))
    try:
        result = run_lockstep(Choice(scenario=turn), tmp_path / "run")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert result.ending is Ending.FAILED
    assert re.search(r"truth\.npz: cannot be written: File too large; .*bus\.log: cannot be", result.reason)
    run = RunDirectory.read(tmp_path / "run")
    assert (run.record.outcome, run.record.reason) == ("failed", result.reason)
    assert run.messages["Articulation"].time_s.size > 50
    assert run.reference["JointLoad"].time_s.size > 50


def test_a_run_that_cannot_start_leaves_the_earlier_one(turn, tmp_path):
    out = tmp_path / "run"
    run_lockstep(Choice(scenario=turn), out)
    before = bytes_of(out)
    with pytest.raises(ConfigurationError, match=r"rear_frame\.mass_kg"):
        run_lockstep(Choice(scenario=turn, changes=("machine.rear_frame.mass_kg=-1",)), out)
    assert bytes_of(out) == before


def test_a_place_that_cannot_be_written_is_reported_in_one_line(turn):
    with pytest.raises(RunError, match=r"/proc/run: cannot be written: No such file or directory"):
        run_lockstep(Choice(scenario=turn), Path("/proc/run"))


def test_choices_reach_the_scenario():
    assert Choice(scenario="loaded", payload_kg=100.0, seed=5).load().payload_mass == 100.0
    assert Choice(scenario="loaded", seed=5).load().seed == 5
    assert Choice(scenario="loaded").load().payload_mass > 3000
    with pytest.raises(ChoiceError, match=r"--payload-kg -1 kg is outside"):
        Choice(scenario="loaded", payload_kg=-1.0).load()


def test_the_same_choice_as_arguments():
    choice = Choice(scenario="loaded", payload_kg=0.1, seed=3, changes=("surface.friction=0.4",))
    words = ["loaded", "--payload-kg", "0.1", "--seed", "3", "--set", "surface.friction=0.4"]
    assert choice.arguments() == words


def test_a_changed_key_reaches_the_machine_that_runs():
    choice = Choice(scenario="standstill", changes=("machine.rear_frame.mass_kg=5000",))
    changed, plain = (lockstep(c.load()) for c in (choice, Choice(scenario="standstill")))
    loads = [bench.run().truth[-1].normal_force.sum() for bench in (plain, changed)]
    assert loads[0] - loads[1] == pytest.approx(9.81 * 1018, rel=1e-3)  # it has 6018 kg


def test_every_frame_on_the_bus_is_known_to_the_dbc(turn):
    from dbc import loader_database

    recording = lockstep(Choice(scenario=turn).load()).run()
    assert {frame.can_id for frame in recording.bus} == set(loader_database().by_id)
