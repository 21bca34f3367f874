"""The Python API in lockstep and on a bus: waiting, stimulating, asserting, and what it says when it fails."""

import asyncio
import math
import subprocess
import sys
import threading
import time

import pytest

from bus.hub.client import HubTransport
from dbc import FOLDER, loader_database
from dbc.database import Database
from deploy.c.core import C
from ecu.core import PYTHON
from hil.rundir import RunDirectory
from testbench.api import Bench, BenchEnded, NotMet, blocking
from testbench.api.driven import NotPossible
from testbench.expect.signals import SignalError
from testbench.restbus.core import RestBusError
from tests.deploy.c.building import compiler
from tests.docs.pages import ROOT
from tests.examples.test_foreign_nodes import foreign, hub  # noqa: F401

RUNNING, DEGRADED = "EcuStatus.State == running", "EcuStatus.State == degraded"

ENGINE = ROOT / "examples" / "engine" / "engine.dbc"


@pytest.fixture(scope="module")
def standing(tmp_path_factory):
    """A scenario that stands for three seconds."""
    from tests.conftest import STANDS

    file = tmp_path_factory.mktemp("api") / "short.toml"
    file.write_text(STANDS.format(duration_s=3.0))
    return file


@pytest.fixture
def bench(standing):
    with blocking(Bench.lockstep(standing)) as bench:
        yield bench


def test_a_condition_that_comes_gives_its_moment(bench):
    moment = bench.wait_for(RUNNING, within_s=1.0)
    assert 0 < moment.time_s < 0.2
    assert moment.value == 1
    assert bench.wait_for(RUNNING, within_s=0.0).time_s == pytest.approx(bench.now_s)


def test_a_stimulus_reaches_the_ecu_and_ends_with_clear(bench):
    bench.wait_for(RUNNING, within_s=1.0)
    at_s = bench.now_s
    bench.stimulate("BodyRates.RollRate", 160.0)
    assert bench.expect(DEGRADED, within_s=0.1).time_s - at_s <= 0.1
    assert bench.value("BodyRates.RollRate") == pytest.approx(160.0)
    bench.clear()
    bench.expect(RUNNING, within_s=1.0)
    bench.holds(RUNNING, for_s=0.2)


def test_what_does_not_come_is_not_met_and_says_what_was_seen(bench):
    bench.run_for(0.5)
    with pytest.raises(NotMet, match=r"degraded within 100 ms of 0\.500 s: EcuStatus\.State was running"):
        bench.expect(DEGRADED, within_s=0.1)
    assert bench.now_s == pytest.approx(0.6, abs=0.011)
    with pytest.raises(NotMet, match=r"for 100 ms: running at 0\.6"):
        bench.holds(DEGRADED, for_s=0.1)


def test_a_fault_is_injected_by_its_table(bench):
    bench.run_for(0.5)
    assert bench.inject(kind="drop", message="WheelSpeeds", for_s=0.3) == "drop WheelSpeeds"
    bench.expect("Limits.Cause == safe_values", within_s=0.2)
    with pytest.raises(NotPossible, match="no kind of fault"):
        bench.inject(kind="wreck")


def test_truth_is_a_signal_in_lockstep(bench):
    bench.run_for(0.1)
    assert abs(bench.value("truth.speed")) < 0.05
    bench.wait_for("truth.normal_force.front_left > 1000", within_s=0.1)


def test_before_the_first_frame_a_value_is_nan(standing):
    with blocking(Bench.lockstep(standing)) as bench:
        assert math.isnan(bench.value("EcuStatus.State"))


def test_a_test_that_waits_beyond_the_scenario_is_reported(bench):
    with pytest.raises(BenchEnded, match=r"ended at 3\.0"):
        bench.run_for(5.0)


def test_a_wrong_signal_names_the_near_one(bench):
    with pytest.raises(SignalError, match="did you mean 'EcuStatus'"):
        bench.wait_for("EcuStatu.State == running", within_s=1.0)


def test_the_recording_is_a_run_directory(standing, tmp_path):
    with blocking(Bench.lockstep(standing, keep=tmp_path / "kept")) as bench:
        bench.run_for(0.5)
        bench.stimulate("BodyRates.RollRate", 160.0)
        bench.run_for(0.2)
    run = RunDirectory.read(tmp_path / "kept")
    assert not run.problems
    assert run.truth["time_s"].size == 70
    assert (run.path / "faults.json").exists()


def test_two_benches_share_one_event_loop(standing):
    async def both():
        async with Bench.lockstep(standing) as one, Bench.lockstep(standing, seed=2) as other:
            await asyncio.gather(one.run_for(0.3), other.run_for(0.3))
            return one.now_s, other.now_s

    assert asyncio.run(both()) == pytest.approx((0.3, 0.3))


def test_a_test_sees_the_same_with_the_ecu_in_c(standing):
    compiler()

    def frames(core):
        with blocking(Bench.lockstep(standing, core=core)) as bench:
            bench.wait_for(RUNNING, within_s=1.0)
            bench.stimulate("BodyRates.RollRate", 160.0)
            bench.expect(DEGRADED, within_s=0.1)
            return list(bench.frames)

    assert frames(C) == frames(PYTHON)


def test_equal_tests_see_equal_frames(standing):
    def frames():
        with blocking(Bench.lockstep(standing)) as bench:
            bench.run_for(0.3)
            bench.stimulate("BodyRates.RollRate", 160.0)
            bench.run_for(0.2)
            return list(bench.frames)

    assert frames() == frames()


@pytest.mark.timeout(30)
def test_time_passes_on_a_bus_on_which_nobody_sends():
    """A controller that is switched off must not hold up its test for ever."""
    made = Bench.on_bus("virtual:silent", simulate=["Engine"], dbc=ROOT / "examples/engine/engine.dbc")
    made._driven.inject({"kind": "drop", "message": "EngineData"})  # before the first frame
    with blocking(made) as bench:
        bench.run_for(0.05)
        assert bench.now_s >= 0.05
        with pytest.raises(NotMet, match="within 100 ms"):
            bench.wait_for("EngineData.Rpm == 5", within_s=0.1)
        assert not bench.frames


def test_a_node_that_the_dbc_lacks_is_said_at_the_start():
    with (
        pytest.raises(RestBusError, match="Dash"),
        blocking(Bench.on_bus("virtual:lacking", simulate=["Dash"], dbc=ROOT / "examples/engine/engine.dbc")),
    ):
        pass


@pytest.mark.processes
@pytest.mark.timeout(300)
class TestOnABus:
    def test_a_foreign_ecu_answers_the_rest_bus(self, hub, tmp_path):  # noqa: F811
        with foreign("ecu", "loaderhil", hub), blocking(Bench.on_bus(f"hub:{hub}", keep=tmp_path)) as bench:
            bench.wait_for(RUNNING, within_s=60.0)
            bench.inject(kind="drop", message="BodyRates")
            bench.expect(DEGRADED, within_s=5.0)
            bench.clear()
            bench.expect(RUNNING, within_s=5.0)
            bench.stimulate("Articulation.ArticulationAngle", 12.0)
            bench.wait_for("Articulation.ArticulationAngle > 11", within_s=5.0)
            with pytest.raises(NotPossible, match=r"Bench\.realtime"):
                bench.inject(kind="delay", message="BodyRates", delay_ms=5)
        assert (tmp_path / "bus.log").stat().st_size > 1000

    def test_a_test_that_thinks_for_long_loses_no_frame(self, hub):  # noqa: F811
        codec = loader_database().by_name["EcuStatus"]
        count = 2000

        def send():
            with HubTransport(str(hub)) as sender:
                from bus.frame import Frame

                for k in range(count):
                    while not sender.send(Frame(codec.can_id, k.to_bytes(8, "little"))):
                        time.sleep(0.001)

        with blocking(Bench.on_bus(f"hub:{hub}", dbc=FOLDER / "loader.dbc")) as bench:
            thread = threading.Thread(target=send)
            thread.start()
            thread.join()  # nobody asks the bench for frames meanwhile
            heard, patience = [], 50
            while len(heard) < count and patience:  # a busy host may take more than one of these
                bench.run_for(0.2)
                heard = [frame for frame in bench.frames if frame.can_id == codec.can_id]
                patience -= 1
        assert [int.from_bytes(frame.data, "little") for frame in heard] == list(range(count))


@pytest.mark.processes
@pytest.mark.timeout(600)
def test_the_same_test_runs_in_real_time(tmp_path):
    with blocking(Bench.realtime("standstill", keep=tmp_path / "run")) as bench:
        bench.wait_for(RUNNING, within_s=20.0)
        bench.stimulate("BodyRates.RollRate", 160.0)
        bench.expect(DEGRADED, within_s=5.0)
        bench.clear()
        bench.expect(RUNNING, within_s=10.0)
    assert RunDirectory.read(tmp_path / "run").messages


def test_a_bench_on_a_bus_of_ones_own_loads_no_compiler_and_no_parser() -> None:
    """Loading one of them takes longer than all the rest of a short test."""
    Database.from_file(ENGINE)  # from now on it is kept
    code = f"""
import sys
from pathlib import Path
from testbench.api import Bench, blocking
with blocking(Bench.on_bus("virtual:light", simulate=["Engine"], dbc=Path({str(ENGINE)!r}))) as rig:
    rig.stimulate("EngineData.Rpm", 2500)
    rig.expect("EngineData.Rpm == 2500", within_s=5.0)
print(*{{"numba", "scipy", "pandas", "pyarrow", "matplotlib", "cantools", "can", "pydantic"}} & set(sys.modules))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
