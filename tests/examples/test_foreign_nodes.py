"""The examples of foreign nodes take part in runs: on the hub, and on vcan where the kernel has CAN."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from bus.hub.client import hub_status
from bus.transport import BusUnavailable
from dbc import FOLDER, loader_database
from dbc.recordings.reading import read_frames
from hil.ending import Ending
from hil.faults.record import read_faults
from hil.rundir import RunDirectory
from tests.bus.conftest import vcan  # noqa: F401
from tests.bus.vcan import INTERFACE
from tests.conftest import STANDS

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
DBC = FOLDER / "loader.dbc"
PATIENCE_S = 270.0
RUNNING, DEGRADED = 1, 2  # EcuStatus.State
processes = [pytest.mark.processes, pytest.mark.timeout(600)]


@contextmanager
def running(*words):
    """A process that is stopped in the end."""
    process = subprocess.Popen(
        [sys.executable, *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGCONT)
            process.terminate()
        process.communicate(timeout=20)


def loaderhil(*words):
    """A command to its end."""
    return subprocess.run(
        [sys.executable, "-m", "loaderhil", *map(str, words)],
        capture_output=True, text=True, timeout=PATIENCE_S, check=False, env={**os.environ, "COLUMNS": "200"},
    )  # fmt: skip


@pytest.fixture
def hub(tmp_path):
    """A hub; the path of its socket."""
    path = tmp_path / "hub"
    with running("-m", "loaderhil", "hub", "--bus", f"hub:{path}"):
        deadline = time.monotonic() + 30.0
        while time.monotonic() < deadline:
            try:
                hub_status(str(path))
                break
            except BusUnavailable:
                time.sleep(0.05)
        yield path


@pytest.fixture
def short(tmp_path):
    """A scenario that stands for two seconds."""
    file = tmp_path / "short.toml"
    file.write_text(STANDS.format(duration_s=2.0))
    return file


def results(done):
    """What `--json` gave: question -> result, reason."""
    assert done.stdout, done.stderr
    cases = json.loads(done.stdout)["suites"][0]["cases"]
    return {case["question"]: (case["result"], case["reason"]) for case in cases}


def foreign(which, interface, channel):
    return running(EXAMPLES / f"foreign_{which}.py", interface, channel, DBC)


class TestOnTheHub:
    pytestmark = processes

    def test_a_foreign_ecu_takes_part(self, hub, short, tmp_path):
        with foreign("ecu", "loaderhil", hub):
            done = loaderhil("run", short, "--ecu", f"hub:{hub}", "--out", tmp_path / "out", "--json")
        found = results(done)
        assert found["EstimatorEcu is there throughout"][0] == "PASSED", found
        assert "waiting for EstimatorEcu" in done.stderr
        run = RunDirectory.read(tmp_path / "out")
        assert run.record.foreign == {"ecu": f"hub:{hub}"}
        assert not run.problems
        assert (run.messages["EcuStatus"].signals["EchoSequence"] > 0).any()
        assert loaderhil("report", tmp_path / "out", "--out", tmp_path / "r.html").returncode == 0

    def test_a_foreign_machine_takes_part(self, hub, short, tmp_path):
        with foreign("plant", "loaderhil", hub):
            done = loaderhil("run", short, "--plant", f"hub:{hub}", "--out", tmp_path / "out", "--json")
        found = results(done)
        assert found["Machine is there throughout"][0] == "PASSED", found
        run = RunDirectory.read(tmp_path / "out")
        assert not run.problems
        assert 1.9 < run.record.duration_s < 4.0
        assert not run.truth
        assert (run.messages["EcuStatus"].signals["State"] == 1).any()
        assert loaderhil("report", tmp_path / "out", "--out", tmp_path / "r.html").returncode == 0

    def test_nobody_comes(self, hub, short, tmp_path):
        done = loaderhil("run", short, "--ecu", f"hub:{hub}", "--out", tmp_path / "out", "--wait-s", 0.5)
        assert done.returncode == Ending.PEER_DIED
        assert "EstimatorEcu sent none of its messages" in done.stderr
        assert "is it powered" in done.stderr

    def test_an_ecu_that_falls_silent_is_reported_and_fails(self, hub, tmp_path):
        file = tmp_path / "short.toml"
        file.write_text(STANDS.format(duration_s=8.0))
        command = [
            sys.executable,
            "-m",
            "loaderhil",
            "run",
            str(file),
            "--ecu",
            f"hub:{hub}",
            "--out",
            str(tmp_path / "out"),
            "--json",
        ]
        with (
            foreign("ecu", "loaderhil", hub) as ecu,
            subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as bench,
        ):
            for line in bench.stderr:  # until the run has begun
                if "EstimatorEcu is there" in line:
                    break
            time.sleep(3.0)
            ecu.send_signal(signal.SIGSTOP)
            out, err = bench.communicate(timeout=PATIENCE_S)
        assert "EstimatorEcu fell silent" in err
        found = {case["question"]: case for case in json.loads(out)["suites"][0]["cases"]}
        assert found["EstimatorEcu is there throughout"]["result"] == "FAILED"
        assert bench.returncode == Ending.FAILED

    def test_two_senders_are_named_and_fail(self, hub, short, tmp_path):
        with foreign("ecu", "loaderhil", hub):
            done = loaderhil(
                "run", short, "--gateway", "--ecu-bus", f"hub:{hub}", "--out", tmp_path / "out", "--json"
            )
        found = results(done)
        result, reason = found["every identifier has one sender"]
        assert result == "FAILED"
        assert "our ecu process and by 'python-can'" in reason
        # counters that jump between two senders are nothing that a busy host could cause
        assert found["every message in time"][0] == "FAILED"
        assert done.returncode == Ending.FAILED

    def test_faults_are_injected_before_a_foreign_ecu(self, hub, tmp_path):
        scenario, faults, out = tmp_path / "short.toml", tmp_path / "faults.toml", tmp_path / "out"
        scenario.write_text(STANDS.format(duration_s=4.0))
        faults.write_text('[[fault]]\nkind = "drop"\nmessage = "BodyRates"\nat_s = 1.0\nfor_s = 1.5\n')
        with foreign("ecu", "loaderhil", hub):
            done = loaderhil(
                *("run", scenario, "--gateway", "--ecu", f"hub:{hub}", "--inject", faults),
                *("--out", out, "--json"),
            )
        assert results(done)["EstimatorEcu is there throughout"][0] != "FAILED"
        run = RunDirectory.read(out)
        states, times = (
            run.messages["EcuStatus"].signals["State"],
            run.messages["EcuStatus"].time_s - run.truth["time_s"][0],
        )
        assert (states[(times > 1.7) & (times < 2.3)] == DEGRADED).all()
        assert (states[(times > 3.0) & (times < 3.8)] == RUNNING).all()
        (fault,) = read_faults(out)
        assert fault.struck > 100
        assert "BodyRates" in loaderhil("check", out, "--json").stdout
        assert loaderhil("report", out, "--out", tmp_path / "r.html").returncode == 0


@pytest.mark.socketcan
@pytest.mark.usefixtures("vcan")
@pytest.mark.timeout(600)
class TestOnVcan:
    @pytest.mark.parametrize("which", ["ecu", "plant"])
    def test_a_foreign_node_takes_part(self, short, tmp_path, which):
        with foreign(which, "socketcan", INTERFACE):
            done = loaderhil(
                "run", short, f"--{which}", f"socketcan:{INTERFACE}", "--out", tmp_path / "out", "--json"
            )
        found = results(done)
        node = {"ecu": "EstimatorEcu", "plant": "Machine"}[which]
        # In a user-mode kernel every process waits for the others. That leaves silences open and must not accuse the node.
        assert found[f"{node} is there throughout"][0] != "FAILED", found
        sent = [c.can_id for c in loader_database().by_name.values() if node in c.senders]
        frames = read_frames(tmp_path / "out" / "bus.log")
        assert np.isin(frames.can_id, sent).sum() > 100
