"""`record`, `replay` and `check` on interfaces of the kernel, beside can-utils' canplayer, candump and cangen."""

import json
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from bus.frame import ERROR
from bus.socketcan.can_socket import kernel_has_can
from bus.socketcan.link import can_interfaces
from dbc import loader_database
from dbc.recordings.logfile import FrameTable, read_candump
from dbc.recordings.writer import candump_line
from hil.compose import lockstep
from hil.ending import Ending
from plant.unit.scenario import load_scenario
from tests.hil.monitor.candump_tool import every_kind

pytestmark = [pytest.mark.socketcan, pytest.mark.timeout(600)]
PATIENCE_S = 120.0
"""A user-mode kernel on a busy machine takes long to start an interpreter."""
FLOOD = 20_000
REPLAYS = 5
SUMMARY = re.compile(r": (\d+) frames .* s, (?:(none)|(\d+)) lost")


@pytest.fixture(autouse=True)
def can_and_its_tools() -> None:
    if not kernel_has_can() or {"vcan0", "vcan1"} - set(can_interfaces()):
        pytest.skip("there are no vcan0 and vcan1; run scripts/with-vcan .venv/bin/pytest -m socketcan")
    if missing := [tool for tool in ("canplayer", "candump", "cangen") if shutil.which(tool) is None]:
        pytest.skip(f"{', '.join(missing)} missing: install can-utils")


def wait_for(condition: Callable[[], bool], what: str) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, what
        time.sleep(0.02)


def listeners(interface: str) -> int:
    """Sockets that take every frame of an interface."""
    return Path("/proc/net/can/rcvlist_all").read_text().count(f" {interface} ")


def loaderhil(*words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "loaderhil", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)


class Recorder:
    """`loaderhil record` while a `with` block lasts; then what it said, and its exit code."""

    def __init__(self, interface: str, file: Path, *options: str) -> None:
        self._words = [
            sys.executable,
            "-m",
            "loaderhil",
            "record",
            f"loader=socketcan:{interface}",
            "--out",
            str(file),
        ]
        self._words += options
        self._interface, self._file = interface, file
        self.said, self.code = "", -1

    @contextmanager
    def running(self) -> Iterator[None]:
        before = listeners(self._interface)
        process = subprocess.Popen(self._words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        try:
            wait_for(lambda: listeners(self._interface) > before, "the recorder never listened")
            wait_for(self._file.exists, "the recorder never opened its file")
            yield
            process.send_signal(signal.SIGTERM)
            self.said, _ = process.communicate(timeout=PATIENCE_S)
            self.code = process.returncode
        finally:
            process.kill()
            process.wait()

    @property
    def counts(self) -> tuple[int, int]:
        """Frames recorded, frames lost, as it said."""
        found = SUMMARY.search(self.said)
        assert found is not None, self.said
        return int(found[1]), int(found[3] or 0)


def content(table: FrameTable) -> list[tuple[int, int, bytes]]:
    return [(frame.can_id, frame.flags, bytes(frame.data)) for frame in table.frames()]


def write(file: Path, frames) -> None:
    file.write_text("".join(f"{candump_line(frame, 'loader')}\n" for frame in frames))


@pytest.fixture(scope="module")
def log(tmp_path_factory) -> Path:
    """A recording of ours: frames of every kind that can be sent, five milliseconds apart."""
    file = tmp_path_factory.mktemp("ours") / "ours.log"
    frames = [frame for frame in every_kind(300, seed=3) if not frame.can_id & ERROR][:200]
    write(file, [frame._replace(at_ns=n * 5_000_000) for n, frame in enumerate(frames)])
    return file


def test_canplayer_plays_our_log_and_we_record_what_it_plays(log, tmp_path):
    recorder = Recorder("vcan0", tmp_path / "again.log")
    with recorder.running():
        subprocess.run(["canplayer", "-I", str(log), "vcan0=loader"], check=True, timeout=PATIENCE_S)
    assert recorder.counts == (200, 0)
    assert recorder.code == Ending.INTERRUPTED
    assert content(read_candump(tmp_path / "again.log")) == content(read_candump(log))


def read_by_candump(log: Path, file: Path) -> tuple[FrameTable, int]:
    """What candump reads of a replay of ours on vcan1, and how late at most the replay says it was [ns]."""
    before = listeners("vcan1")
    with file.open("wb") as output:
        candump = subprocess.Popen(["candump", "-L", "-n", "200", "vcan1"], stdout=output)
        try:
            wait_for(lambda: listeners("vcan1") > before, "candump never listened")
            done = loaderhil("replay", log, "socketcan:vcan1")
            assert done.returncode == Ending.PASSED, done.stderr
            candump.wait(PATIENCE_S)
        finally:
            candump.kill()
            candump.wait()
    said = re.search(r"largest ([\d.]+) ms", done.stdout)
    assert said is not None, done.stdout
    return read_candump(file), round(1e6 * float(said[1]))


def test_candump_reads_what_we_replay_at_its_time(log, tmp_path):
    """Every frame in order; none earlier than its recorded time after the first, as far as that one was late itself.

    How late the replay was it says; a tenth of the recording makes the times worthless. A busy machine does that, and
    stamps the first frame later than it was sent, to one replay; a replay that keeps no time is so every time.
    """
    ours = read_candump(log)
    found = []
    for n in range(REPLAYS):
        seen, late_ns = read_by_candump(log, tmp_path / f"candump{n}.log")
        assert content(seen) == content(ours)
        recorded, played = (table.time_ns - table.time_ns[0] for table in (ours, seen))
        early_ns = int((recorded - played).max())
        found.append(f"{early_ns * 1e-6:.1f} ms early, said to be {late_ns * 1e-6:.1f} ms late")
        # 1 ms: stamps of two clocks, each cut at 1 us
        if early_ns < late_ns + 1_000_000 and late_ns < recorded[-1] / 10:
            return
    pytest.fail("; ".join(found))


@pytest.mark.parametrize("ring_frames", [1 << 18, 64])
def test_under_a_flood_every_frame_is_recorded_or_reported(tmp_path, ring_frames):
    """cangen counts in the data: what is missing in the file is exactly what the recorder says it lost."""
    recorder = Recorder("vcan0", tmp_path / "flood.log", "--ring-frames", str(ring_frames))
    flood = ["cangen", "vcan0", "-g", "0", "-p", "10", "-n", str(FLOOD), "-I", "123", "-L", "8", "-D", "i"]
    with recorder.running():
        subprocess.run(flood, check=True, timeout=PATIENCE_S)
    recorded, lost = recorder.counts
    assert recorded + lost == FLOOD
    assert (recorder.code == Ending.FAILED) == (lost > 0)
    table = read_candump(tmp_path / "flood.log")
    numbers = table.data[:, :8].copy().view("<u8").ravel().astype(np.int64)
    assert len(numbers) == recorded
    assert np.all(np.diff(numbers) >= 1)
    missing = FLOOD - len(np.unique(numbers))
    assert missing == lost
    if ring_frames == 64:
        assert lost > 0
        assert "in the ring" in recorder.said


def test_what_was_replayed_and_recorded_is_checked(tmp_path):
    """Two seconds of both nodes: whatever the host did to the times, no frame is lost, repeated or out of order."""
    made = lockstep(load_scenario("standstill"), reference=False)
    for _ in range(200):
        made.step()
    write(tmp_path / "made.log", made.recording.bus)
    recorder = Recorder("vcan1", tmp_path / "heard.log")
    with recorder.running():
        done = loaderhil("replay", tmp_path / "made.log", "socketcan:vcan1")
        assert done.returncode == Ending.PASSED, done.stderr
    assert recorder.counts == (len(made.recording.bus), 0)
    judged = loaderhil("check", tmp_path / "heard.log", "--json", "--tolerance", "0.99")
    assert judged.returncode in (Ending.PASSED, Ending.FAILED), judged.stderr
    found = json.loads(judged.stdout)
    verdicts = [message["verdict"] for message in found["messages"]]
    assert len(verdicts) == sum(bool(codec.cycle_ns) for codec in loader_database().by_name.values())
    for verdict in verdicts:
        assert verdict["duplicates"] == verdict["backwards"] == 0, verdict
        assert verdict["result"] in ("PASSED", "FAILED"), verdict
        assert verdict["reason"]
