"""`loaderhil record` and its writer as processes: nothing readable is lost by any kill, and each end has its line."""

import os
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from bus.frame import FD, Frame
from dbc.errors import LogError
from dbc.recordings.reading import read_frames
from hil.ending import Ending
from hil.recording.capture import Lost, Source, SourceError, parse_sources
from hil.recording.files import Plan
from hil.recording.formats import RecordingError
from hil.recording.ring import Ring
from hil.recording.writing import WriterProcess
from tests.bus.hub.running import RunningHub
from tests.bus.laws import WAIT_S
from tests.children import command_lines

PATIENCE_S = 60.0


def numbered(first, count):
    return [Frame(0x100, k.to_bytes(8, "big"), 1000 * k) for k in range(first, first + count)]


def numbers(path):
    """The numbers of the frames in a file; [] while there is no whole one."""
    try:
        return [int.from_bytes(frame.data, "big") for frame in read_frames(path).frames()]
    except LogError:
        return []


def until(condition):
    """Wait for another process; a failure if it does not come."""
    deadline = time.monotonic() + PATIENCE_S
    while not (found := condition()):
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.01)
    return found


class TestSources:
    @pytest.mark.parametrize(
        ("text", "name", "address"),
        [
            ("socketcan:can0", "can0", "socketcan:can0"),
            ("hub:/tmp/loaderhil.hub", "loaderhil", "hub:/tmp/loaderhil.hub"),
            ("hub:@bench", "bench", "hub:@bench"),
            ("rear=hub:/tmp/a=b.hub", "rear", "hub:/tmp/a=b.hub"),
            ("hub:/tmp/a=b.hub", "a=b", "hub:/tmp/a=b.hub"),
        ],
    )
    def test_a_bus_is_called_after_its_address_or_as_named(self, text, name, address):
        assert Source.parse(text) == Source(name, address)

    @pytest.mark.parametrize("text", ["socketcan:", "my bus=socketcan:can0", "=socketcan:can0"])
    def test_a_name_that_a_log_cannot_hold_is_refused(self, text):
        with pytest.raises(SourceError, match="cannot be the name of a channel"):
            Source.parse(text)

    def test_two_buses_of_one_name_are_reported(self):
        with pytest.raises(SourceError, match="hub:/a/x and hub:/b/x would both be called 'x'"):
            parse_sources(["hub:/a/x", "hub:/b/x"])


def test_losses_are_reported_with_their_cause():
    assert str(Lost(0, 0)) == "none lost"
    assert str(Lost(2, 3)).startswith("5 lost (2 before the recorder")
    assert "in the ring" not in str(Lost(2, 0))


@pytest.mark.processes
@pytest.mark.parametrize("suffix", [".log", ".blf", ".asc", ".mf4"])
def test_a_writer_killed_at_any_moment_leaves_everything_it_flushed(tmp_path, suffix):
    """kill -9 while it writes: what could be read just before can still be read, in order and without a gap."""
    for seed in range(2):
        ring = Ring.create(slots=4096)
        path = tmp_path / f"{seed}{suffix}"
        writer = WriterProcess(ring, Plan(path=path, channels=("can0",), flush_s=0.01))
        pause, put, seen = 0.013 + 0.017 * seed, 0, []
        while len(seen) < 300 + 700 * seed:
            if put - len(seen) < 2000:  # the writer may stand still for a while: the ring has to hold it
                ring.put(numbered(put, 50), 0)
                put += 50
            time.sleep(pause * 0.1)
            seen = numbers(path)
        ring.put(numbered(put, 1500), 0)  # it will be at it
        assert ring.dropped == 0
        time.sleep(pause)
        os.kill(writer.pid, signal.SIGKILL)
        written = writer.finish()
        assert "code -9" in written.error
        found = numbers(path)
        assert written.paths == (path,)
        assert len(seen) <= written.frames <= len(found), "its summary said 0 frames of 1 695"
        assert found[: len(seen)] == seen
        assert found == list(range(len(found)))
        ring.close()


@pytest.mark.processes
def test_what_is_in_the_ring_when_it_is_let_go_is_written(tmp_path):
    ring = Ring.create(slots=4096)
    path = tmp_path / "a.blf"
    writer = WriterProcess(ring, Plan(path=path, channels=("can0",), flush_s=30))
    ring.put(numbered(0, 4000), 0)
    written = writer.finish()
    assert (written.frames, written.paths, written.error) == (4000, (path,), "")
    assert numbers(path) == list(range(4000))
    ring.close()


@pytest.mark.processes
def test_a_full_disk_ends_the_recording_with_what_fitted(tmp_path):
    """A file-size limit stands in for the disk; everything before it stays readable."""
    ring = Ring.create(slots=4096)
    path = tmp_path / "a.log"
    script = f"import resource, runpy, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, 40_000)); {RUN_WRITER}"
    writer = WriterProcess(ring, Plan(path=path, channels=("can0",), flush_s=0.01), program=("-c", script))
    ring.put(numbered(0, 500), 0)
    until(lambda: len(numbers(path)) == 500)
    ring.put(numbered(500, 3000), 0)
    written = writer.finish()
    assert "a.log: File too large" in written.error
    assert written.frames == 500
    assert numbers(path)[:500] == list(range(500))
    ring.close()


RUN_WRITER = "import signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN); runpy.run_module('hil.recording.writing', run_name='__main__')"


@pytest.mark.processes
def test_a_file_that_exists_is_refused_before_anything_is_recorded(tmp_path):
    path = tmp_path / "a.log"
    path.write_text("mine")
    ring = Ring.create(slots=64)
    with pytest.raises(RecordingError, match=r"a\.log: exists"):
        WriterProcess(ring, Plan(path=path, channels=("can0",)))
    ring.close()


@contextmanager
def recorder(*words):
    """`loaderhil record`, killed with its writer if the test leaves it."""
    process = subprocess.Popen(
        [sys.executable, "-m", "loaderhil", "record", *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        writers = command_lines(process.pid)
        process.kill()
        process.communicate()
        for pid in writers:
            until(lambda pid=pid: not Path(f"/proc/{pid}").exists())


def waiting_ns(pid):
    """How long a process has waited for a processor so far [ns], proc(5)."""
    return int(Path(f"/proc/{pid}/schedstat").read_text().split()[1])


@pytest.fixture
def hubs(tmp_path):
    running = [RunningHub(str(tmp_path / name)) for name in ("front", "rear")]
    yield running
    for hub in running:
        hub.stop()


def listens(hub):
    return lambda: hub.hub.status().clients


@pytest.mark.processes
class TestRecord:
    def test_two_buses_into_one_file_until_ctrl_c(self, hubs, tmp_path):
        path = tmp_path / "both.log"
        with recorder(*(f"hub:{hub.path}" for hub in hubs), "--out", path) as process:
            until(lambda: len(command_lines(process.pid)) == 1)
            with hubs[0].connect() as front, hubs[1].connect() as rear:
                until(lambda: send_until_seen((front, rear), path))
                process.send_signal(signal.SIGINT)
                out, errors = process.communicate(timeout=WAIT_S)
        assert process.returncode == Ending.INTERRUPTED
        assert errors == ""
        table = read_frames(path)
        assert set(table.channels) == {"front", "rear"}
        assert len(out.splitlines()) == 1
        assert f"both.log: {len(table)} frames of 2 buses in" in out
        assert "none lost" in out
        assert abs(time.time_ns() - int(table.time_ns[-1])) < 3600e9  # wall-clock time

    def test_a_recorder_killed_hard_loses_nothing_that_had_come(self, hubs, tmp_path):
        """kill -9 of the listening process: the writer finishes the file."""
        path = tmp_path / "killed.mf4"
        with recorder(f"hub:{hubs[0].path}", "--out", path, "--flush-s", "0.05") as process:
            (writer,) = until(lambda: command_lines(process.pid))
            with hubs[0].connect() as bus:
                until(lambda: send_until_seen((bus,), path))
                seen = len(read_frames(path))
                process.kill()
                until(lambda: not Path(f"/proc/{writer}").exists())
        table = read_frames(path)
        assert len(table) >= seen
        assert table.damaged_count == 0

    @pytest.mark.parametrize("suffix", [".log", ".blf", ".asc", ".mf4"])
    def test_kill_of_both_processes_loses_a_fifth_of_a_second_at_most(self, hubs, tmp_path, suffix):
        """Beyond the 0.2 s a frame may only be missing for as long as the host let the recorder wait for a processor."""
        path = tmp_path / f"killed{suffix}"
        sent: list[int] = []
        with recorder(f"hub:{hubs[0].path}", "--out", path) as process:
            (writer,) = until(lambda: command_lines(process.pid))
            with hubs[0].connect() as bus:
                until(lambda: send_until_seen((bus,), path))
                waited_ns = -waiting_ns(process.pid) - waiting_ns(writer)
                for _ in range(60):
                    bus.send(Frame(0x124, bytes(12), 0, FD))
                    sent.append(time.monotonic_ns())
                    time.sleep(0.01)
            waited_ns += waiting_ns(process.pid) + waiting_ns(writer)
            killed_ns = time.monotonic_ns()
            os.kill(writer, signal.SIGKILL)
            process.kill()
        old_ns = killed_ns - 200_000_000 - waited_ns
        due = sum(at_ns < old_ns for at_ns in sent)
        table = read_frames(path)
        assert np.count_nonzero(table.can_id == 0x124) >= due
        assert table.damaged_count == 0

    def test_a_lost_hub_is_reported_and_the_other_bus_recorded_on(self, hubs, tmp_path):
        path = tmp_path / "one.log"
        with recorder(*(f"hub:{hub.path}" for hub in hubs), "--out", path) as process:
            with hubs[0].connect() as front, hubs[1].connect() as rear:
                until(lambda: send_until_seen((front, rear), path))
                hubs.pop().stop()
                before = len(read_frames(path))
                until(lambda: send_until_seen((front,), path, beyond=before + 10))
            process.send_signal(signal.SIGTERM)
            out, errors = process.communicate(timeout=WAIT_S)
        assert process.returncode == Ending.HUB_LOST
        assert "lost the bus" in errors
        assert "rear" in errors
        assert "front" not in errors
        assert f"{len(read_frames(path))} frames" in out

    def test_by_itself_after_its_time(self, hubs, tmp_path):
        path = tmp_path / "timed.blf"
        with recorder(f"hub:{hubs[0].path}", "--out", path, "--duration-s", "0.05") as process:
            out, errors = process.communicate(timeout=PATIENCE_S)
        assert (process.returncode, errors) == (Ending.PASSED, "")
        took_s = re.search(r"0 frames .*in ([\d.]+) s", out)
        assert took_s is not None, out
        assert float(took_s[1]) >= 0.05  # longer, where the host was busy

    @pytest.mark.parametrize(
        ("words", "code", "named"),
        [
            (("hub:{hub}", "--out", "{tmp}/a.csv"), Ending.MISUSED, "a.csv: the suffix names the format"),
            (("hub:{hub}", "--out", "{tmp}/none/a.log"), Ending.MISUSED, "none/a.log: cannot be written"),
            (("hub:{tmp}/nowhere", "--out", "{tmp}/a.log"), Ending.HUB_LOST, "there is no hub"),
        ],
    )
    def test_what_cannot_be_recorded_is_one_line(self, hubs, tmp_path, words, code, named):
        filled = [word.format(hub=hubs[0].path, tmp=tmp_path) for word in words]
        with recorder(*filled) as process:
            out, errors = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == code
        assert len(errors.splitlines()) == 1
        assert named in errors
        assert not (tmp_path / "a.log").exists()
        assert out == ""


def send_until_seen(buses, path, beyond=0):
    """Send on every bus; whether the file has frames of all of them, and more than `beyond`."""
    for bus in buses:
        bus.send(Frame(0x123, bytes(12), 0, FD))
    try:
        table = read_frames(path)
    except LogError:
        return False
    return len(set(table.channel.tolist())) >= len(buses) and len(table) > beyond
