"""`loaderhil monitor` as a process: in a pipeline, at a hub, interrupted."""

import json
import os
import pty
import re
import signal
import subprocess
import sys
import termios
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from bus.frame import Frame
from bus.hub.client import hub_status
from dbc.recordings.logfile import parse_candump
from dbc.recordings.writer import candump_line
from tests.bus.hub.running import RunningHub
from tests.bus.laws import collect, numbered
from tests.hil.monitor.candump_tool import every_kind
from tests.hil.monitor.make_golden import file_of
from tests.hil.monitor.traffic import machine_frames

pytestmark = pytest.mark.processes
LONG_S = 100.0
"""For a process to start on a busy machine; one that takes longer hangs."""
COMMAND = (sys.executable, "-m", "loaderhil", "monitor")


@pytest.fixture(scope="module", autouse=True)
def compiled() -> None:
    """The parser of logs is compiled before any process has to be quick with it."""
    parse_candump(b"(1.5) can0 123#11\n")


@pytest.fixture
def hub(tmp_path: Path) -> Iterator[RunningHub]:
    running = RunningHub(str(tmp_path / "bench.hub"))
    yield running
    running.stop()


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """A log far larger than any pipe."""
    path = tmp_path / "drive.log"
    frames = every_kind(5000, seed=7)
    text = "".join(candump_line(frame, "can0") + "\n" for frame in frames)
    path.write_text(text)
    return path


def start(*words: object, **options: object) -> subprocess.Popen:
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options}
    return subprocess.Popen([*COMMAND, *map(str, words)], text=True, **pipes)


def wait_for_monitors(hub: RunningHub, count: int = 1) -> None:
    while sum(client.name == "monitor" for client in hub_status(hub.path).clients) < count:
        time.sleep(0.01)


def send_all(hub: RunningHub, frames: list[Frame]) -> None:
    """Send, and return once the hub has given every frame to everybody who takes it."""
    with hub.connect() as witness, hub.connect() as sender:
        for start in range(0, len(frames), 100):
            piece = frames[start : start + 100]
            for frame in piece:
                sender.send(frame)
            collect(witness, len(piece))


def ended(process: subprocess.Popen, code: int) -> tuple[str, str]:
    """What it printed that has not been read yet, after checking how it ended."""
    with process:  # not `communicate`: it forgets what `readline` has read ahead
        assert process.stdout is not None
        assert process.stderr is not None
        out, errors = process.stdout.read(), process.stderr.read()
    assert process.returncode == code, errors
    assert "Traceback" not in errors
    return out, errors


def test_a_log_goes_through_unchanged() -> None:
    golden = file_of("-L")
    process = start("--raw", "-L", f"{golden},0:0,#FFFFFFFF")
    assert ended(process, 0) == (golden.read_text(), "")


def test_a_reader_that_leaves_ends_it_quietly(log: Path) -> None:
    process = start("--raw", log)
    assert process.stdout is not None
    assert process.stdout.readline()
    process.stdout.close()
    assert process.wait(LONG_S) == 0
    assert process.stderr is not None
    assert process.stderr.read() == ""
    process.stderr.close()


def test_the_shells_head_gets_its_lines(log: Path) -> None:
    line = f"{sys.executable} -m loaderhil monitor --raw {log} | head -n 3"
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", line], capture_output=True, text=True, check=False, timeout=LONG_S
    )
    assert (done.returncode, done.stdout.count("\n"), done.stderr) == (0, 3, "")


def test_ctrl_c_prints_what_came_and_one_line(hub: RunningHub) -> None:
    process = start("--raw", f"hub:{hub.path}")
    wait_for_monitors(hub)
    send_all(hub, numbered(100))
    assert process.stdout is not None
    first = process.stdout.readline()
    process.send_signal(signal.SIGINT)
    out, errors = ended(process, 130)
    assert (first + out).count("\n") == 100
    assert errors == "loaderhil: interrupted after 100 frames, none lost\n"


def test_ctrl_c_ends_it_though_nobody_reads(log: Path) -> None:
    process = start("--raw", log)
    assert process.stdout is not None
    process.stdout.readline()  # it runs, and soon the pipe is full
    process.send_signal(signal.SIGINT)
    assert process.wait(LONG_S) == 130
    ended(process, 130)


def test_count_and_silence_end_it(hub: RunningHub) -> None:
    counting = start("--raw", "-n", 5, f"hub:{hub.path}")
    wait_for_monitors(hub)
    patient = start("--raw", "-T", 5000, f"hub:{hub.path}")  # its silence counts from its own start
    wait_for_monitors(hub, 2)
    send_all(hub, numbered(8))
    assert ended(counting, 0)[0].count("\n") == 5
    assert ended(patient, 0)[0].count("\n") == 8


def test_the_end_of_the_bus_is_reported(tmp_path: Path) -> None:
    hub = RunningHub(str(tmp_path / "ending.hub"))
    process = start("--raw", f"hub:{hub.path}")
    wait_for_monitors(hub)
    hub.stop()
    _, errors = ended(process, 4)
    assert errors == f"loaderhil: lost the bus: {hub.path}: the hub is gone\n"


def test_a_slow_reader_learns_what_it_lost(hub: RunningHub) -> None:
    """The bus is never held up; every frame is either shown or counted, and both counts are printed."""
    process = start("--raw", "-L", "-d", f"hub:{hub.path}")
    wait_for_monitors(hub)
    sent = 0
    while not any(client.dropped for client in hub_status(hub.path).clients):
        send_all(hub, numbered(5000))
        sent += 5000
    with hub.connect() as sender:
        assert process.stdout is not None
        lines = [process.stdout.readline()]
        while "7FF#" not in lines[-1]:
            sent += sender.send(Frame(0x7FF, b""))  # the drop count travels with a frame
            lines.append(process.stdout.readline())
        while not sender.send(Frame(0x7FE, b"")):
            time.sleep(0.01)
        while "7FE#" not in lines[-1]:
            lines.append(process.stdout.readline())
    process.send_signal(signal.SIGINT)
    out, errors = ended(process, 130)
    assert out == ""
    lines = "".join(lines).splitlines()
    counts = [
        re.fullmatch(r"DROPCOUNT: dropped (\d+) CAN frames? on 'bench' socket .*", line) for line in lines
    ]
    lost = sum(int(match[1]) for match in counts if match)
    shown = sum("#" in line for line in lines)
    assert lost > 0
    assert shown + lost == sent + 1
    assert "fell behind: " in errors
    assert errors.splitlines()[-1].endswith(f"{lost} lost")


def test_a_log_file_has_candumps_name_and_lines(hub: RunningHub, tmp_path: Path) -> None:
    folder = tmp_path / "logs"
    folder.mkdir()
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    process = start("--raw", "-l", "-n", 3, f"hub:{hub.path}", cwd=folder, env=environment)
    wait_for_monitors(hub)
    send_all(hub, numbered(3))
    out, errors = ended(process, 0)
    (written,) = folder.iterdir()
    assert out == ""
    assert errors == f"loaderhil: logging into {written.name}\n"
    assert re.fullmatch(r"candump-\d{4}-\d\d-\d\d_\d{6}\.log", written.name)
    lines = written.read_text().splitlines()
    assert [line.split()[2] for line in lines] == ["100#00000000", "100#00000001", "100#00000002"]
    assert {line.split()[1] for line in lines} == {"bench"}


def machine_log(path: Path) -> Path:
    path.write_text("".join(candump_line(frame, "can0") + "\n" for frame in machine_frames()))
    return path


def test_in_a_pipe_lines_are_the_default_and_json_is_json(tmp_path: Path) -> None:
    log = machine_log(tmp_path / "machine.log")
    plain, objects = start(log, "-m", "BodyRates"), start(log, "--json", "-m", "BodyRates,Articulation")
    lines = ended(plain, 0)[0].splitlines()
    assert len(lines) == 100
    assert all(" can0  BodyRates Crc=" in line and " deg/s, State=ok" in line for line in lines)
    named = {json.loads(line)["message"] for line in ended(objects, 0)[0].splitlines()}
    assert named == {"BodyRates", "Articulation"}


def test_a_table_in_a_pipe_comes_once_without_colours(tmp_path: Path) -> None:
    out, _ = ended(start(machine_log(tmp_path / "machine.log"), "--table"), 0)
    assert "\33" not in out
    assert out.count("VehicleSpeed ") == 1


def test_on_a_terminal_the_table_is_live_and_ctrl_c_gives_the_terminal_back(hub: RunningHub) -> None:
    master, slave = pty.openpty()
    termios.tcsetwinsize(slave, (24, 80))
    environment = {**os.environ, "TERM": "xterm"}
    process = start(f"hub:{hub.path}", stdin=slave, stdout=slave, env=environment)
    os.close(slave)
    wait_for_monitors(hub)
    send_all(hub, list(machine_frames()))
    screen = b""
    while b"VehicleSpeed" not in screen:
        screen += os.read(master, 65536)
    process.send_signal(signal.SIGINT)
    while not screen.endswith(b"\33[?1049l") and b"\33[?25h\33[?1049l" not in screen:
        screen += os.read(master, 65536)
    assert process.stderr is not None
    with process:
        assert process.stderr.read().startswith("loaderhil: interrupted after ")
    assert process.returncode == 130
    assert screen.startswith(b"\33[?1049h\33[?25l")
    os.close(master)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--lines", "--json", "can0"), "--lines and --json: choose one"),
        (("--lines", "-x", "can0"), "-x: only with --raw"),
        (("--lines", "-m", "Nothing", "can0"), "no message 'Nothing' in"),
        (("--lines", "--dbc", "no.dbc", "can0"), "no.dbc: cannot read the DBC"),
        (("--raw", "-t", "x", "can0"), "'x' is not one of a, A, d, z"),
        (("--raw", "-L", "-a", "can0"), "-L has no room for -a, -i or -S"),
        (("--raw", "can0,12"), "filter '12': not ID:MASK"),
        (("--raw", "no/such.log"), "'no/such.log': no such file, and no bus"),
        (("--raw", "-f", "hub:/tmp/x"), "--follow is for a recording"),
    ],
)
def test_misuse_is_one_line_and_exit_code_2(words: tuple[str, ...], says: str) -> None:
    _, errors = ended(start(*words), 2)
    assert says in errors
