"""A run as processes: however it ends, there is a clear line, a distinct exit code, and nothing left running."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from dbc import loader_database
from dbc.recordings.reading import read_frames
from ecu.states import State
from hil import rundir
from hil.compose import Choice
from hil.ending import Ending
from hil.judgement import timing_of
from hil.processes import realtime
from hil.rundir import RunDirectory
from tests.children import alive, command_lines

pytestmark = [pytest.mark.processes, pytest.mark.timeout(240)]
PATIENCE_S = 150.0
"""On a small machine the first start compiles the plant."""


@contextmanager
def started(*arguments) -> Iterator[subprocess.Popen[str]]:
    """`loaderhil ARGUMENTS` in a process group of its own; whatever is left of it at the end is a failure."""
    process = subprocess.Popen(
        [sys.executable, "-m", "loaderhil", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        process_group=0,
    )
    known: set[int] = set()
    try:
        process.known = known  # type: ignore[attr-defined]
        yield process
    finally:
        known |= set(children(process.pid).values())
        if process.poll() is None:
            process.kill()
        process.communicate()
        left = [pid for pid in known if alive(pid)]
        for pid in left:
            os.kill(pid, signal.SIGKILL)
        assert not left


def children(pid: int) -> dict[str, int]:
    """Process ids of the bench by what they do."""
    words = command_lines(pid)
    return {line[3]: child for child, line in words.items() if line[1:3] == ["-m", "loaderhil"]}


def wait_until_running(process: subprocess.Popen[str], out: Path) -> dict[str, int]:
    """Until the plant ticks and the recorder writes; the processes of a bench on one bus."""
    found = wait_until_ticking(process, out)
    assert set(found) == {"hub", "record", "ecu", "plant"}
    return found


def wait_until_ticking(process: subprocess.Popen[str], out: Path) -> dict[str, int]:
    """Until the plant ticks and the recorder writes; the processes there are, by command."""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        assert process.poll() is None, process.communicate()
        for log in (out / "bus.log", out / "reference.log"):
            if not log.exists() or log.stat().st_size == 0:
                break
        else:
            found = children(process.pid)
            process.known.update(found.values())  # type: ignore[attr-defined]
            return found
        time.sleep(0.05)
    raise AssertionError("the bench did not start")


def end(process: subprocess.Popen[str]) -> tuple[int, str]:
    _, errors = process.communicate(timeout=PATIENCE_S)
    return process.returncode, errors


@pytest.mark.parametrize("core", ["python", "c"])
def test_a_run_to_its_end_leaves_a_complete_directory(scenario, tmp_path, core):
    out = tmp_path / "run"
    with started("run", scenario(2.0), "--realtime", "--ecu-core", core, "--out", out) as process:
        wait_until_running(process, out)
        code, errors = end(process)
    assert errors == ""
    assert code in (Ending.PASSED, Ending.FAILED)  # a busy host may miss deadlines
    run = RunDirectory.read(out)
    assert run.problems == ()
    assert (run.record.outcome, run.record.ecu_core) == ("finished", core)
    assert run.truth["time_s"][-1] == pytest.approx(2.0)
    assert {"Articulation", "NormalForces", "Limits", "EcuStatus"} <= set(run.messages)
    assert "WheelForceFrontLeft" in run.reference
    samples = run.messages["Articulation"]
    assert len(samples.time_s) == len(run.truth["time_s"])  # the recorder lost nothing
    assert np.all(np.diff(samples.signals["SampleSequence"]) == 1)
    status = run.messages["EcuStatus"]
    echoes = status.signals["EchoSequence"][status.time_s >= samples.time_s[0]]
    assert timing_of(run).reaction.count == np.intersect1d(samples.signals["SampleSequence"], echoes).size
    assert timing_of(run).reaction.count > fewest_reactions(run)
    assert timing_of(run).dropped == 0


def fewest_reactions(run: RunDirectory) -> int:
    """Half of the samples, less those of the ticks that the ECU says it was too late for."""
    return max(len(run.messages["Articulation"].time_s) - timing_of(run).overruns["ecu"], 0) // 2


USELESS = {
    "hub": ("numpy", "scipy", "llvmlite", "pandas", "pyarrow"),
    "record": ("scipy", "llvmlite", "pandas", "pyarrow"),
    "gateway": ("scipy", "llvmlite", "pandas", "pyarrow"),
    "ecu": ("pandas", "pyarrow"),
    "plant": ("pandas", "pyarrow"),
}
"""Libraries that a process has no use for; each would cost it tens of megabytes and its start a part of a second."""


def test_the_record_holds_the_first_frames_of_the_ecu_however_slowly_the_recorder_starts(
    scenario, tmp_path, monkeypatch
):
    of_record = realtime._record
    late = ["sh", "-c", 'sleep 6; exec "$@"', "sh"]
    monkeypatch.setattr(realtime, "_record", lambda *words: [*late, *of_record(*words)])
    result = realtime.run_realtime(Choice(scenario=str(scenario(0.5))), tmp_path / "run")
    assert result.ending is Ending.PASSED, result.reason
    first = {}
    for frame in read_frames(tmp_path / "run" / rundir.BUS).frames():
        first.setdefault(frame.can_id, frame)
    by_name = loader_database().by_name
    assert by_name["EcuStatus"].decode_dict(first[by_name["EcuStatus"].can_id].data)["State"] == State.INIT
    sent = [c for c in by_name.values() if "EstimatorEcu" in c.senders and c.protection is not None]
    assert {first[c.can_id].data[1] & 0x0F for c in sent if c.can_id in first} == {0}


def test_no_process_loads_a_library_that_it_does_not_use(scenario, tmp_path):
    out = tmp_path / "run"
    with started("run", scenario(60.0), "--realtime", "--gateway", "--out", out) as process:
        pids = wait_until_ticking(process, out)
        loaded = {name: Path(f"/proc/{pid}/maps").read_text() for name, pid in pids.items()}
        process.send_signal(signal.SIGINT)
        end(process)
    assert set(loaded) == set(USELESS)
    found = {
        name: [each for each in useless if f"/{each}/" in loaded[name]] for name, useless in USELESS.items()
    }
    assert not any(found.values()), found


def test_bus_and_truth_share_a_clock(scenario, tmp_path):
    """The frame of sample k is on the bus within the tick that made it, on the truth's own clock; how late that tick was the plant says."""
    out = tmp_path / "run"
    with started("run", scenario(2.0), "--realtime", "--out", out) as process:
        wait_until_running(process, out)
        end(process)
    run = RunDirectory.read(out)
    age = run.messages["Articulation"].time_s - run.truth["time_s"]
    until_end = (run.timing["plant_lateness_ns"] + run.timing["plant_execution_ns"]) * 1e-9
    assert np.median(age - until_end) < 0.005
    assert np.all(age > -0.001)


@pytest.mark.parametrize(
    ("victim", "code"), [("ecu", Ending.PEER_DIED), ("plant", Ending.PEER_DIED), ("hub", Ending.HUB_LOST)]
)
def test_a_killed_process_ends_the_run_in_one_clear_line(scenario, tmp_path, victim, code):
    out = tmp_path / "run"
    with started("run", scenario(60.0), "--realtime", "--out", out) as process:
        pids = wait_until_running(process, out)
        os.kill(pids[victim], signal.SIGKILL)
        assert end(process) == (
            code,
            f"loaderhil: the {victim} process ({pids[victim]}) was killed by SIGKILL\n",
        )
    run = RunDirectory.read(out)
    assert run.record.outcome == "failed"
    assert "killed by SIGKILL" in run.record.reason
    assert len(run.messages["Articulation"].time_s) > 0  # what was recorded until then reads
    assert len(run.truth["time_s"]) > 0, "what was true before the kill is on disk, of a killed plant too"


def test_a_hub_killed_before_the_others_are_ready_is_a_lost_bus(scenario, tmp_path):
    out = tmp_path / "run"
    with started("run", scenario(60.0), "--realtime", "--out", out) as process:
        deadline = time.monotonic() + PATIENCE_S
        while "ecu" not in (pids := children(process.pid)):
            assert time.monotonic() < deadline
            time.sleep(0.01)
        process.known.update(pids.values())  # type: ignore[attr-defined]
        os.kill(pids["hub"], signal.SIGKILL)
        code, errors = end(process)
    assert code == Ending.HUB_LOST
    assert errors == f"loaderhil: the hub process ({pids['hub']}) was killed by SIGKILL\n"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_keeps_what_it_has(scenario, tmp_path, number):
    out = tmp_path / "run"
    with started("run", scenario(60.0), "--realtime", "--out", out) as process:
        wait_until_running(process, out)
        process.send_signal(number)
        assert end(process) == (Ending.INTERRUPTED, "loaderhil: interrupted\n")
    run = RunDirectory.read(out)
    assert run.record.outcome == "interrupted"
    assert len(run.truth["time_s"]) > 0
    assert run.problems == ()


def test_a_killed_recorder_leaves_a_readable_log(scenario, tmp_path):
    out = tmp_path / "run"
    with started("run", scenario(60.0), "--realtime", "--out", out) as process:
        pids = wait_until_running(process, out)
        os.kill(pids["record"], signal.SIGKILL)
        code, errors = end(process)
    assert code == Ending.PEER_DIED
    assert "recorder process" in errors
    assert len(RunDirectory.read(out).messages["Articulation"].time_s) > 0


def test_a_process_by_hand_makes_the_folder_of_its_results(tmp_path):
    out = tmp_path / "new" / "folder"
    with started("ecu", "--bus", f"hub:{tmp_path / 'nowhere'}", "--out", out) as process:
        code, errors = end(process)
    assert code == Ending.HUB_LOST
    assert "there is no hub" in errors
    assert out.is_dir()


def test_a_plant_without_a_bus_says_what_to_do(scenario, tmp_path):
    with started("plant", scenario(1.0), "--bus", f"hub:{tmp_path / 'nowhere'}") as process:
        _, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == Ending.HUB_LOST
    assert len(errors.splitlines()) == 1
    assert "nowhere" in errors
