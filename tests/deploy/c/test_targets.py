"""The exported ECU where it is meant to run: on a Cortex-M4F in QEMU, and as a Linux program on a CAN interface."""

import itertools
import shutil
import signal
import struct
import subprocess
import time

import pytest

from bus.address import open_transport
from bus.socketcan.can_socket import kernel_has_can
from dbc import loader_database
from dbc.protection import Checker, Finding
from deploy.c.replays import answers_of, frames_file
from tests.deploy.c.building import compiler
from tests.deploy.c.ecu_build import BuiltEcu
from tests.deploy.c.test_ecu_in_c import moving
from tests.ecu.machine import PERIOD_NS, FakeMachine

RAM_BUDGET = 32 * 1024
"""Of static memory and stack [bytes]: half of the smallest Cortex-M4F with a CAN controller, 64 KiB."""
FLASH_BUDGET = 128 * 1024


def make(folder, target, *needed):
    """Build by the exported Makefile; skips without its tools."""
    for tool in ("make", *needed):
        if shutil.which(tool) is None:
            pytest.skip(f"no {tool}")
    run = subprocess.run(
        ["make", "--no-print-directory", "-C", str(folder), target],
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
    """The same frames through QEMU and through the host's build of the same single precision: equal to the bit."""
    printed = make(ecu_sources, "cortex_m4/ecu.elf", "arm-none-eabi-gcc", "qemu-system-arm")
    calls = list(drive(150))
    frames_file(ecu_sources / "frames.bin", calls)
    subprocess.run(["make", "-C", str(ecu_sources), "replay"], capture_output=True, check=True, timeout=200)
    found = answers_of(ecu_sources / "answers.bin")
    host = BuiltEcu(ecu_single)
    expected = []
    for frame, now in calls:
        if frame is not None:
            host.receive(frame, now)
        else:
            expected.append([(f.can_id, f.data) for f in host.tick(now).frames])
    assert found.ticks == expected
    text, data, bss = map(int, printed.splitlines()[-1].split()[:3])
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


def test_the_linux_program_names_what_is_wrong(ecu_sources):
    """An interface that is not there: exit code 4 and its name; no argument: exit code 2."""
    compiler()
    make(ecu_sources, "linux/loader-ecu")
    program = ecu_sources / "linux/loader-ecu"
    lost = subprocess.run([program, "can987"], capture_output=True, text=True, check=False)
    assert (lost.returncode, lost.stderr.startswith("can987: ")) == (4, True)
    assert subprocess.run([program], capture_output=True, check=False).returncode == 2


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
