"""The exported ECU where it is meant to run: on a Cortex-M4F in QEMU, and as a Linux program on a CAN interface."""

import itertools
import os
import random
import re
import shutil
import signal
import socket
import struct
import subprocess
import threading
import time

import pytest

from bus.address import open_transport
from bus.frame import Frame
from bus.socketcan.can_socket import kernel_has_can
from bus.socketcan.transport import SocketCanTransport
from dbc import loader_database
from dbc.protection import Checker, Finding
from deploy.c.replays import answers_of, frames_file
from tests.bus.conftest import vcan  # noqa: F401
from tests.bus.laws import collect
from tests.bus.vcan import ip
from tests.deploy.c.building import build, compiler
from tests.deploy.c.ecu_build import BuiltEcu
from tests.deploy.c.test_ecu_in_c import moving
from tests.ecu.machine import PERIOD_NS, FakeMachine

RAM_BUDGET = 32 * 1024
"""Of static memory and stack [bytes]: half of the smallest Cortex-M4F with a CAN controller, 64 KiB."""
FLASH_BUDGET = 128 * 1024


def make(folder, target, *needed, options="OPTIONS="):
    """Build by the exported Makefile; skips without its tools. options: its variable of that name."""
    for tool in ("make", *needed):
        if shutil.which(tool) is None:
            pytest.skip(f"no {tool}")
    run = subprocess.run(
        ["make", "--no-print-directory", "-C", str(folder), target, options],
        capture_output=True,
        text=True,
        check=False,
        timeout=240,
    )
    assert run.returncode == 0, run.stdout[-2000:] + run.stderr[-2000:]
    return run.stdout


def drive(ticks):
    """Frames of a drive with a message that falls silent and comes back, and the times of the ticks."""
    machine = FakeMachine()
    for k in range(ticks):
        moving(machine, k)
        machine.silent = {"BodyRates"} if 60 <= k < 75 else set()
        now = machine.now_ns
        yield from ((frame, now) for frame in machine.frames())
        yield None, now + PERIOD_NS // 2


@pytest.mark.processes
def test_a_cortex_m4_answers_as_the_host_does(ecu_sources, ecu_single):
    """The same frames through QEMU and through the host's build of the same single precision: equal to the bit, also when it starts anew."""
    make(ecu_sources, "cortex_m4/ecu.elf", "arm-none-eabi-gcc", "qemu-system-arm")
    calls = list(drive(150))
    frames_file(ecu_sources / "frames.bin", calls, calls)
    subprocess.run(["make", "-C", str(ecu_sources), "replay"], capture_output=True, check=True, timeout=200)
    found = answers_of(ecu_sources / "answers.bin")
    host = BuiltEcu(ecu_single)
    expected = []
    for frame, now in calls:
        if frame is not None:
            host.receive(frame, now)
        else:
            expected.append([(f.can_id, f.data) for f in host.tick(now).frames])
    assert found.ticks == expected * 2
    # asked by itself: another test may have built the firmware, and make then prints no size
    sizes = subprocess.run(
        ["arm-none-eabi-size", ecu_sources / "cortex_m4/ecu.elf"], capture_output=True, text=True, check=True
    )
    text, data, bss = map(int, sizes.stdout.splitlines()[-1].split()[:3])
    assert text + data < FLASH_BUDGET
    assert data + bss + found.stack < RAM_BUDGET
    assert max(found.instructions) > 0


@pytest.mark.socketcan
def test_the_linux_program_is_an_ecu_on_the_bus(ecu_sources):
    """It answers a machine with intact frames in their order, runs, and ends by SIGTERM."""
    if not kernel_has_can():
        pytest.skip("this kernel has no CAN; run scripts/with-vcan .venv/bin/pytest -m socketcan")
    compiler()
    make(ecu_sources, "linux/loader-ecu")
    machine, codecs = FakeMachine(), loader_database().by_id
    heard, checkers, wrong = {}, {}, []
    with open_transport("socketcan:vcan0", name="machine") as bus:
        ecu = subprocess.Popen([ecu_sources / "linux/loader-ecu", "vcan0"])
        try:
            start = time.monotonic()
            for k in itertools.count():
                if time.monotonic() - start > 3.0:
                    break
                moving(machine, k)
                for frame in machine.frames():
                    bus.send(frame)
                time.sleep(max(start + (k + 1) * 0.01 - time.monotonic(), 0.0))
                for frame in bus.drain():
                    codec = codecs[frame.can_id]
                    heard.setdefault(codec.name, []).append(codec.decode_dict(frame.data))
                    if codec.protection is not None:
                        checker = checkers.setdefault(codec.name, Checker(codec))
                        check = checker.check(frame.data, frame.at_ns)
                        wrong += (
                            [(codec.name, check)] if check in (Finding.WRONG_CRC, Finding.REORDERED) else []
                        )
            ecu.send_signal(signal.SIGTERM)
            assert ecu.wait(timeout=20) == 0
        finally:
            ecu.kill()
    assert not wrong
    sent = {codec.name for codec in codecs.values() if "EstimatorEcu" in codec.senders}
    assert heard.keys() == sent
    assert {status["State"] for status in heard["EcuStatus"]} & {1.0, 2.0}


@pytest.fixture
def linux_program(ecu_sources):
    """The exported program for Linux, called to its end."""
    compiler()
    make(ecu_sources, "linux/loader-ecu")
    return lambda *words: subprocess.run(
        [ecu_sources / "linux/loader-ecu", *words], capture_output=True, text=True, check=False, timeout=60
    )


def test_help_opens_no_interface(linux_program):
    shown = linux_program("--help")
    assert (shown.returncode, shown.stderr) == (0, "")
    assert all(
        option in shown.stdout
        for option in ("--bus", "--no-limits", "--fifo", "--lock-memory", "--cpu", "--listen-s")
    )


WRONG_OPTIONS = (
    ((), "usage: loader-ecu"),
    (("--calibration", "l60", "can0"), "there is no option --calibration"),
    (("can0", "--fifo"), "--fifo (nothing): it takes a priority of 1 to 99"),
    (("can0", "--fifo", "100"), "--fifo 100: it takes"),
    (("can0", "--fifo", "5x"), "--fifo 5x: it takes"),
    (("can0", "--cpu", "-1"), "--cpu -1: it takes"),
    (("can0", "--listen-s", "nan"), "--listen-s nan: it takes"),
    (("--bus", "hub:/tmp/x"), "--bus hub:/tmp/x: it takes socketcan:INTERFACE"),
    (("an-interface-name",), "at most 15 letters"),
    (("can0", "--uds", "0x1"), "--uds 0x1: give two CAN identifiers"),
    (("can0", "--uds", "0x1,0x40000000"), "give two CAN identifiers"),
    (("can0", "--xcp", "-1,2"), "give two CAN identifiers"),
    (("can0", "--xcp", "0x7,7"), "their frames would collide"),
    (("can0", "--xcp", "0x600,0x601", "--uds", "0x601,0x602"), "share an identifier"),
    (
        ("can0", "--uds", f"0x600,{loader_database().by_name['Limits'].can_id & 0x1FFFFFFF:#x}"),
        "of Limits",
    ),
    (("can0", "--j1939", "identity=1"), "a NAME needs manufacturer, as in identity=1,manufacturer=0"),
    (("can0", "--j1939", "maker=1"), "a NAME has the fields identity, manufacturer,"),
    (("can0", "--j1939", "identity=one,manufacturer=0"), "there is no whole number for identity"),
    (("can0", "--j1939", "identity=1,manufacturer=2048"), "too large for manufacturer"),
    (("can0", "--access-key", "/no/such/file"), "/no/such/file: cannot be read"),
    (("can0", "--access-key", "/dev/null"), "a secret has 16 to 4096 bytes, this file 0"),
)


@pytest.mark.parametrize(("words", "said"), WRONG_OPTIONS)
def test_wrong_options_end_in_one_line_before_a_bus_is_opened(linux_program, words, said):
    refused = linux_program(*words)
    assert refused.returncode == 2
    assert said in refused.stderr
    assert refused.stdout == ""


def sanitized(folder, program, sanitizers):
    """The program for Linux, which ends by itself where a sanitizer finds something."""
    sources = [file for place in ("linux/*.c", "services/*.c", "*.c") for file in sorted(folder.glob(place))]
    return build(
        sources, program, "-std=c99", "-O1", "-g", f"-fsanitize={sanitizers}", "-fno-sanitize-recover=all", "-ffp-contract=off",
        "-DECU_DOUBLE", "-DECU_FINDINGS", "-DECU_SETTABLE", f"-I{folder}",
    )  # fmt: skip


def test_sanitizers_find_nothing_in_how_the_linux_program_reads_its_words(ecu_sources, tmp_path):
    program = sanitized(ecu_sources, tmp_path / "loader-ecu", "address,undefined")
    for words, said in (*WRONG_OPTIONS, (("an-interface-that-is-far-too-long" * 200,), "at most 15 letters")):
        done = subprocess.run([program, *words], capture_output=True, text=True, check=False, timeout=60)
        assert (done.returncode, said in done.stderr, "Sanitizer" in done.stderr) == (2, True, False), words


@pytest.mark.socketcan
def test_sanitizers_find_nothing_in_the_linux_program_on_a_bus(ecu_sources, tmp_path):
    """Frames of the machine, of random bits and identifiers, and of tools; a user-mode kernel has no room for the address sanitizer."""
    if not kernel_has_can():
        pytest.skip("this kernel has no CAN; run scripts/with-vcan .venv/bin/pytest -m socketcan")
    program = sanitized(ecu_sources, tmp_path / "loader-ecu", "undefined,float-cast-overflow")
    machine, generator = FakeMachine(), random.Random(8)
    name = "identity=1,manufacturer=0"
    words = ("vcan0", "--xcp", "0x600,0x601", "--uds", "0x602,0x603", "--j1939", name)
    with open_transport("socketcan:vcan0", name="machine") as bus:
        ecu = subprocess.Popen([program, *words], stderr=subprocess.PIPE, text=True)
        try:
            for k in range(300):
                moving(machine, k)
                strange = [generator.getrandbits(29) | 0x80000000, 0x600, 0x602, *loader_database().by_id]
                for frame in machine.frames():
                    bus.send(frame)
                for _ in range(5):
                    content = generator.randbytes(generator.randrange(9))
                    bus.send(Frame(generator.choice(strange), content, 0))
                time.sleep(0.01)
                bus.drain()
            ecu.send_signal(signal.SIGTERM)
            said = ecu.communicate(timeout=20)[1]
        finally:
            ecu.kill()
    assert (ecu.returncode, "runtime error" in said) == (0, False), said[-2000:]


def test_the_log_calls_every_message_by_its_name(ecu_sources):
    """Names and frames are tables of two files, in one order: that of the schedule."""
    names = (ecu_sources / "linux/ecu_names.c").read_text().partition("names_of_sent")[2].partition("};")[0]
    frames = (ecu_sources / "ecu_tables.c").read_text().partition("output_frames[")[2].partition("};")[0]
    identifiers = [int(number, 16) for number in re.findall(r"\.id = (0x[0-9a-f]+)U", frames)]
    assert re.findall(r'"(\w+)"', names) == [loader_database().by_id[can_id].name for can_id in identifiers]


def test_an_interface_that_is_not_there_is_named(linux_program):
    lost = linux_program("--bus", "socketcan:can987")
    assert lost.returncode == 4
    expected = "can987: no such CAN interface" if kernel_has_can() else "this kernel has no CAN"
    assert expected in lost.stderr


@pytest.mark.socketcan
@pytest.mark.usefixtures("vcan")
class TestAsADropIn:
    """What the exported program does beside estimating, on a real interface."""

    def test_systemd_hears_that_it_is_ready_and_ticks(self, ecu_sources, linux_program, tmp_path):
        path = tmp_path / "notify"
        heard = []
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
            systemd.bind(str(path))
            systemd.settimeout(20.0)
            environment = {**os.environ, "NOTIFY_SOCKET": str(path), "WATCHDOG_USEC": "200000"}
            environment.pop("WATCHDOG_PID", None)
            with subprocess.Popen([ecu_sources / "linux/loader-ecu", "vcan0"], env=environment) as ecu:
                started = time.monotonic()
                while heard.count("WATCHDOG=1") < 10:
                    heard.append(systemd.recv(4096).decode())
                took = time.monotonic() - started
                ecu.terminate()
                while heard[-1] != "STOPPING=1":
                    heard.append(systemd.recv(4096).decode())
                assert ecu.wait(timeout=20) == 0
        assert heard[0].startswith("READY=1\nSTATUS=")
        # four in the time-out: a service manager would end a program that pings less than once in it
        assert took < 10 * 0.2

    @pytest.mark.parametrize("removed", [False, True], ids=["down", "removed"])
    def test_it_goes_on_when_its_interface_is_back(self, ecu_sources, linux_program, removed, tmp_path):
        name, log = "vcan6", tmp_path / "log"

        def made():
            ip("link", "add", "dev", name, "type", "vcan")

        def frames():
            with SocketCanTransport(name) as bus:
                collect(bus, 5)

        made()
        ip("link", "set", name, "up")
        with (
            log.open("w") as errors,
            subprocess.Popen([ecu_sources / "linux/loader-ecu", name], stderr=errors) as ecu,
        ):
            try:
                frames()
                ip("link", *(("del", name) if removed else ("set", name, "down")))
                time.sleep(0.3)
                assert ecu.poll() is None
                if removed:
                    made()
                ip("link", "set", name, "up")
                frames()
                ecu.terminate()
                assert ecu.wait(timeout=20) == 0
            finally:
                ecu.kill()
                ip("link", "del", name)
        lines = [line for line in log.read_text().splitlines() if "bus: interface" in line]
        assert any("went down" in line or "was removed" in line for line in lines)
        assert f"WARNING bus: interface is up again ({name})" in lines[-1]

    def test_it_listens_before_it_sends(self, linux_program):
        """Another ECU is on the bus: exit code 1, and not one frame."""
        stop = threading.Event()
        own = {c.can_id for c in loader_database().by_name.values() if "EstimatorEcu" in c.senders}

        def other_ecu():
            with SocketCanTransport("vcan0") as bus:
                while not stop.wait(0.02):
                    bus.send(Frame(loader_database().by_name["Limits"].can_id, bytes(8)))

        thread = threading.Thread(target=other_ecu)
        with SocketCanTransport("vcan0") as witness:
            thread.start()
            try:
                refused = linux_program("vcan0", "--listen-s", "2")
            finally:
                stop.set()
                thread.join()
            seen = [frame for frame in witness.drain(4096) if frame.can_id in own]
        assert (refused.returncode, "another node sends Limits" in refused.stderr) == (1, True)
        assert {frame.data for frame in seen} <= {bytes(8)}


def test_answers_of_qemu_are_read_as_they_are_written(tmp_path):
    """One tick with one frame, then the depth of the stack."""
    mark = 0xFFFFFFFF
    records = [
        struct.pack("<4I", mark, 1, 80, 0),
        struct.pack("<IB3x8s", 0x123, 2, b"\x01\x02"),
        struct.pack("<4I", mark, mark, 512, 0),
    ]
    (tmp_path / "answers.bin").write_bytes(b"".join(records))
    found = answers_of(tmp_path / "answers.bin")
    assert found.ticks == [[(0x123, b"\x01\x02")]]
    assert (found.instructions, found.stack) == ([80], 512)
