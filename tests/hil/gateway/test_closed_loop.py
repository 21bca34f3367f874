"""The closed loop at 100 Hz for twenty seconds over two buses, with somebody else's program reading along.

One test for both kinds of bus: two vcan interfaces with Debian's candump, and two hubs with python-can's
logger. What is judged is the software: that no frame is lost on any hop, that what we recorded is what the
other program saw, and that every deadline gets a verdict. Whether the host gave the processes their time is
the host's matter: a verdict may be inconclusive, but then it says why.
"""

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
from bus.socketcan.link import can_interfaces
from dbc import loader_database
from dbc.recordings.logfile import read_candump
from hil.ending import Ending
from hil.gateway.hops import AGE, REACTION
from hil.judgement import timing_of
from hil.rundir import BUS, ECU_BUS, RunDirectory
from hil.timing.deadlines import Observation, Observer, judge_message
from hil.timing.measured import judge_timing
from hil.verdict import Result

DURATION_S = 20.0
PATIENCE_S = 400.0
"""A user-mode kernel on a busy machine takes minutes to start six interpreters."""
SCENARIO = """
name = "circle"
sentence = "Drives off and turns."
duration_s = {duration_s}
machine = "l60"
seed = 3

[driver.speed_kmh]
points = [[0.0, 0.0], [4.0, 8.0]]

[driver.articulation_deg]
points = [[0.0, 0.0], [6.0, 0.0], [10.0, 20.0]]
"""
STAMP_US = 3.0
"""Stamps of two programs differ by the constant between two clocks (NTP slews both alike), each cut off at 1 us."""


class Vcan:
    """Two interfaces of the kernel, and candump on both."""

    options = ("--plant-bus", "socketcan:vcan0", "--ecu-bus", "socketcan:vcan1")

    def __init__(self, folder: Path) -> None:
        self._log = folder / "candump.log"

    @contextmanager
    def witnessed(self):
        with self._log.open("wb") as output:
            candump = subprocess.Popen(["candump", "-L", "-r", "8000000", "vcan0", "vcan1"], stdout=output)
        try:
            table = Path("/proc/net/can/rcvlist_all")
            wait_for(lambda: all(name in table.read_text() for name in ("vcan0", "vcan1")))
            yield
        finally:
            candump.terminate()
            candump.wait(30)

    def seen(self) -> dict[str, Path]:
        """Its log, split by interface."""
        lines = self._log.read_text().splitlines(keepends=True)
        for name in ("vcan0", "vcan1"):
            self._log.with_name(name).write_text("".join(line for line in lines if f" {name} " in line))
        return {BUS: self._log.with_name("vcan0"), ECU_BUS: self._log.with_name("vcan1")}


class Hubs:
    """Two hubs, and python-can's logger on each."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._paths = {BUS: folder / "a", ECU_BUS: folder / "b"}
        self.options = ("--plant-bus", f"hub:{folder / 'a'}", "--ecu-bus", f"hub:{folder / 'b'}")

    @contextmanager
    def witnessed(self):
        processes = []
        try:
            for path in self._paths.values():
                processes.append(start("-m", "loaderhil", "hub", "--bus", f"hub:{path}"))
                wait_for(path.exists)
            for name, path in self._paths.items():
                log = str(self._folder / f"logger-{name}")
                processes.append(start("-m", "can.logger", "-i", "loaderhil", "-c", str(path), "-f", log))
            for path in self._paths.values():
                wait_for(lambda path=path: hub_status(str(path)).clients)
            yield
        finally:
            for process in reversed(processes):
                process.send_signal(signal.SIGINT)
                process.wait(30)

    def seen(self) -> dict[str, Path]:
        """A log per hub."""
        return {name: self._folder / f"logger-{name}" for name in self._paths}


def start(*words: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, process_group=0
    )


def loaderhil(*words) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "loaderhil", *map(str, words)],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )


def compile_once(scenario: Path, folder: Path) -> None:
    """In one process, before several would compile the same at once on one processor."""
    short = folder / "warm" / scenario.name
    short.parent.mkdir()
    short.write_text(SCENARIO.format(duration_s=0.2))
    done = loaderhil("run", short, "--out", folder / "compiled")
    assert done.returncode == Ending.PASSED, done.stderr


def wait_for(condition, patience_s: float = 60.0) -> None:
    deadline = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < deadline, "it did not come up"
        time.sleep(0.05)


@pytest.fixture(
    scope="module",
    params=[
        pytest.param(Vcan, marks=pytest.mark.socketcan, id="vcan"),
        pytest.param(Hubs, marks=pytest.mark.processes, id="hub"),
    ],
)
def loop(request, tmp_path_factory):
    """(run directory, logs of the other program) of one run of the loop."""
    if request.param is Vcan and not {"vcan0", "vcan1"} <= set(can_interfaces()):
        pytest.skip("there is no vcan0 and vcan1; scripts/with-vcan lends one")
    folder = tmp_path_factory.mktemp("loop")
    scenario = folder / "circle.toml"
    scenario.write_text(SCENARIO.format(duration_s=DURATION_S))
    buses, out = request.param(folder), folder / "run"
    compile_once(scenario, folder)
    with buses.witnessed():
        done = loaderhil("run", scenario, "--gateway", *buses.options, "--out", out)
    print(done.stdout)
    assert done.stderr == ""
    assert done.returncode in (Ending.PASSED, Ending.FAILED)  # timing may fail; nothing else may
    return RunDirectory.read(out), buses.seen()


pytestmark = pytest.mark.timeout(2 * int(PATIENCE_S))


def test_the_loop_was_closed_for_its_whole_time(loop):
    run, _ = loop
    assert run.problems == ()
    assert run.record.outcome == "finished"
    assert run.record.duration_s >= DURATION_S
    samples = run.messages["Articulation"]
    assert len(samples.time_s) >= DURATION_S * 100
    echoes = run.messages["EcuStatus"].signals["EchoSequence"]
    assert np.unique(echoes).size > 0.05 * len(
        samples.time_s
    )  # on a starved host it echoes fewer, never none
    assert np.ptp(run.truth["articulation_angle"]) > 0.1  # the machine moved, so the frames differed


def test_no_frame_was_lost_on_any_hop(loop):
    run, _ = loop
    count = run.record.statistics
    assert count["plant_sent"] == count["gateway_plant_received"] == count["gateway_ecu_sent"]
    assert count["gateway_ecu_sent"] == count["ecu_received"]
    assert count["ecu_sent"] == count["gateway_ecu_received"] == count["gateway_plant_sent"]
    assert {name: lost for name, lost in count.items() if name.endswith("_dropped") and lost} == {}
    assert np.all(np.diff(run.messages["Articulation"].signals["SampleSequence"]) == 1)
    for name, columns in run.messages.items():
        if "AliveCounter" in columns.signals:
            assert np.all(np.diff(columns.signals["AliveCounter"]) % 15 == 1), name
    # A sender that was kept from its processor is late, and a pause of 15 cycles looks like a loss; nothing else may.
    bad = ("wrong_crc", "masqueraded", "repeated", "reordered", "wrong_length", "stayed", "overflowed")
    assert {name: k for name, k in count.items() if any(word in name for word in bad)} == {}


@pytest.mark.parametrize("name", [BUS, ECU_BUS])
def test_our_recording_is_what_the_other_program_saw(loop, name):
    run, logs = loop
    ours, theirs = read_candump(run.path / name), read_candump(logs[name])
    assert ours.damaged_count == theirs.damaged_count == 0
    assert len(ours.time_ns) > 2 * 100 * DURATION_S
    assert ours.can_id.tolist() == theirs.can_id.tolist()
    assert ours.length.tolist() == theirs.length.tolist()
    np.testing.assert_array_equal(ours.data, theirs.data)
    apart_us = (ours.time_ns - theirs.time_ns) * 1e-3
    assert np.ptp(apart_us) < STAMP_US, np.sort(apart_us - np.median(apart_us))[[0, 1, -2, -1]]


def test_both_buses_carried_the_same_frames_in_the_same_order_per_sender(loop):
    run, _ = loop
    plant, ecu = (read_candump(run.path / name) for name in (BUS, ECU_BUS))
    for sender in ("Machine", "EstimatorEcu"):
        ids = [c.can_id for c in loader_database().by_name.values() if sender in c.senders]
        a, b = (log.data[np.isin(log.can_id, ids)] for log in (plant, ecu))
        np.testing.assert_array_equal(a, b)


def test_every_deadline_was_judged(loop):
    """Each cyclic message passes, fails with what it missed, or is inconclusive with the reason."""
    run, _ = loop
    timing = timing_of(run)
    starved = judge_timing(timing)
    assert starved.reason
    figures = run.record.statistics
    ends = run.truth["time_s"][[0, -1]] * 1e9
    observer = Observer(
        start_ns=int(ends[0]),
        end_ns=int(ends[1]),
        lost=int(figures["recorder_dropped"]),
        starved=starved.reason if starved.result is Result.INCONCLUSIVE else "",
    )
    for name, columns in run.messages.items():
        stamps = np.rint(columns.time_s * 1e9).astype(np.int64)
        seen = Observation(
            name=name,
            period_ns=loader_database().by_name[name].cycle_ns or None,
            at_ns=stamps[(stamps >= ends[0]) & (stamps <= ends[1])],
        )
        verdict = judge_message(seen, observer)
        assert verdict.reason
        if observer.starved:  # excuses what was late, and nothing else
            expected = Result.INCONCLUSIVE if verdict.events else Result.PASSED
            assert verdict.result is expected, verdict


def test_the_reaction_was_timed_hop_by_hop(loop):
    run, _ = loop
    hops = timing_of(run).hops
    assert hops[REACTION].count > 0.05 * DURATION_S * 100
    assert all(hop.count == hops[REACTION].count for hop in hops.values())
    assert hops[AGE].median > 0
    assert os.path.getsize(run.path / "latency.hlog") > 0  # noqa: PTH202
