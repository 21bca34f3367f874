"""The services of the C host build: its hash by the standards' own examples, its transport beside can-isotp, and its bounds."""

import ctypes
import hashlib
import os
import random
import shutil
import struct
import subprocess
import sys

import can
import pytest

from bus.frame import EXTENDED_MASK, Frame
from ecu.measure.access import CALIBRATE, key_of
from ecu.measure.parameters import calibration_numbers
from tests.bus.conftest import vcan  # noqa: F401
from tests.bus.vcan import INTERFACE
from tests.deploy.c.beside import put_beside, services_library
from tests.deploy.c.building import STRICT, build, compiler
from tests.deploy.c.test_targets import make
from tests.ecu.uds.tool import CHANNEL, UdsEcu, client_on
from tests.ecu.uds.virtual_time import virtual_timers
from tests.ecu.xcp.tool import CHANNEL as XCP
from tests.ecu.xcp.tool import SECRET
from tests.fuzz.services import tool_frames

SHA_256 = {
    b"": "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855",
    b"abc": "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad",
    b"abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq": (
        "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1"
    ),
    b"a" * 1_000_000: "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0",
}
"""Examples of FIPS 180-4, and of NIST's page of examples."""
HMAC = [
    (b"\x0b" * 20, b"Hi There", "b0344c61d8db38535ca8afceaf0bf12b881dc200c9833da726e9376c2e32cff7"),
    (b"Jefe", b"what do ya want for nothing?", "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843"),
    (b"\xaa" * 20, b"\xdd" * 50, "773ea91e36800e46854db8ebd09181a72959098b3ef8c122d9635514ced565fe"),
    (
        b"\xaa" * 131,
        b"Test Using Larger Than Block-Size Key - Hash Key First",
        "60e431591ee0b67f0d8a26aacbf5b77f8e0bc6213728c5140546040f0ee37f54",
    ),
]  # fmt: skip
"""Test cases 1, 2, 3 and 6 of RFC 4231."""


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    return services_library(tmp_path_factory.mktemp("services"))


@pytest.fixture(scope="module")
def hashes(library):
    return ctypes.CDLL(str(library))


def hashed(hashes, data):
    state, digest = (ctypes.c_uint8 * 256)(), (ctypes.c_uint8 * 32)()
    hashes.sha256_start(state)
    for at in range(0, len(data), 1000):  # in pieces that fit no block
        hashes.sha256_add(state, data[at : at + 1000], ctypes.c_uint32(len(data[at : at + 1000])))
    hashes.sha256_end(state, digest)
    return bytes(digest)


def test_the_hash_is_that_of_the_standards_examples(hashes):
    for data, digest in SHA_256.items():
        assert hashed(hashes, data).hex() == digest


def test_the_hash_is_right_around_the_ends_of_blocks(hashes):
    for length in (55, 56, 57, 63, 64, 65, 119, 120, 128):
        data = bytes(range(length))
        assert hashed(hashes, data) == hashlib.sha256(data).digest()


@pytest.mark.parametrize(("key", "data", "digest"), HMAC)
def test_the_key_is_the_hmac_of_the_rfcs_cases(hashes, key, data, digest):
    block, found = (ctypes.c_uint8 * 64)(), (ctypes.c_uint8 * 32)()
    hashes.hmac_key(key, ctypes.c_uint32(len(key)), block)
    hashes.hmac_sha256(block, data, ctypes.c_uint32(len(data)), found)
    assert bytes(found).hex() == digest


@pytest.mark.parametrize("seed", range(12))
def test_transfers_of_every_kind_end_as_with_can_isotp(library, seed):
    """Long requests and answers, pauses, blocks, wrong numbers, silence: the same frames at the same times."""
    rng, answered, late = random.Random(seed), 0, 0
    with virtual_timers(lambda: ecu.now_ns + late):
        ecu = put_beside(UdsEcu(), library, secret=SECRET, uds=CHANNEL)
        ecu.cycles(20)
        for data in tool_frames(rng, 600):
            if data is None:
                late += rng.choice((10, 10, 10, 40, 990, 1_010, 5_100)) * 1_000_000
                ecu.service.before_cycle(ecu.now_ns + late)
                answered += len(ecu.service.after_cycle(ecu.now_ns + late))
            else:
                answered += len(ecu.service.receive(Frame(CHANNEL.receive, data), ecu.now_ns + late))
    assert answered > 200


def test_no_precision_no_heap_and_no_board_is_needed(ecu_sources):
    """Single precision compiles as cleanly, and nothing but memory and comparison functions is called."""
    files = sorted((ecu_sources / "services").glob("*.c"))
    for precision in ((), ("-DECU_DOUBLE",)):
        out = ecu_sources / "services.o"
        build(files, out, *STRICT, f"-I{ecu_sources}", "-r", "-DECU_SETTABLE", *precision)
        symbols = subprocess.run(["nm", "-u", out], capture_output=True, text=True, check=True).stdout.split()
        foreign = {
            s for s in symbols if s != "U" and not s.startswith(("ecu_", "codes_", "inputs_", "service_"))
        }
        assert foreign <= {
            "memcpy", "memmove", "memset", "__memcpy_chk", "__stack_chk_fail", "_GLOBAL_OFFSET_TABLE_", "calibration_parameters",
            "calibration_limits", "detection_makes", "detection_tolerances", "detection_rules", "noise_of_residuals", "suspects", "alarm_times", "alarm_holds", "machine_rules", "warning_rules", "rint", "rintf",
        }  # fmt: skip


@pytest.mark.processes
def test_a_firmware_without_services_has_nothing_of_them(ecu_sources):
    make(ecu_sources, "cortex_m4/ecu.elf", "arm-none-eabi-gcc")
    names = subprocess.run(
        ["arm-none-eabi-nm", ecu_sources / "cortex_m4/ecu.elf"], capture_output=True, text=True, check=True
    ).stdout
    for name in (
        "ecu_tick",
        "codes_cleared",
        "codes_all",
        "ecu_inputs",
        "noise_of_residuals",
        "ecu_values",
        "uds_",
        "isotp_",
        "sha256",
    ):
        assert (name in names) == (name == "ecu_tick"), name


@pytest.mark.processes
def test_sanitizers_find_nothing_with_random_frames(tmp_path):
    compiler()
    library = services_library(
        tmp_path,
        "-Wno-error",
        "-O1",
        "-g",
        "-fsanitize=address,undefined,float-cast-overflow",
        "-fno-sanitize-recover=all",
    )
    runtime = subprocess.run(
        [compiler(), "-print-file-name=libasan.so"], capture_output=True, text=True, check=True
    ).stdout.strip()
    done = subprocess.run(
        [sys.executable, "-m", "tests.deploy.c.sanitized_services", str(library), "7", "20000"],
        env=os.environ | {"LD_PRELOAD": runtime, "ASAN_OPTIONS": "detect_leaks=0"},
        capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    assert int(done.stdout) > 1000


@pytest.mark.processes
def test_cppcheck_finds_nothing(ecu_sources):
    if shutil.which("cppcheck") is None:
        pytest.skip("no cppcheck: Debian's package cppcheck")
    done = subprocess.run(
        ["cppcheck", "--enable=warning,style,performance,portability", "--std=c99", "--quiet", "--inline-suppr",
         "--error-exitcode=1", "-I.", "-DECU_DOUBLE", "-DECU_SETTABLE", "services"],
        cwd=ecu_sources, capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]


@pytest.mark.socketcan
@pytest.mark.usefixtures("vcan")
@pytest.mark.timeout(300)
def test_the_linux_program_is_diagnosed_and_calibrated_on_its_interface(ecu_sources, tmp_path):
    """udsoncan reads who it is and restarts it with the key; XCP reads a number, is refused without its key, and writes it with it."""
    make(ecu_sources, "linux/loader-ecu")
    key = tmp_path / "access.key"
    key.write_bytes(SECRET + b"\n")
    options = ("--uds", "0x18DA80F1,0x18DAF180", "--xcp", "0x18EF80F9,0x18EFF980", "--access-key", key)
    with subprocess.Popen([ecu_sources / "linux/loader-ecu", *options, INTERFACE]) as ecu:
        try:
            with can.Bus(interface="socketcan", channel=INTERFACE) as bus:
                assert bus.recv(20) is not None
            # without the ECU's other frames, which a user-mode kernel does not get through to Python in time
            with only(CHANNEL.send) as bus, client_on(bus) as client:
                identity = client.read_data_by_identifier([0xF190]).service_data.values
                assert identity[0xF190] == "LOADERHILL6000000"
                assert client.get_supported_dtc().service_data.dtc_count > 100
                client.change_session(3)
                client.unlock_security_access(1)
                client.ecu_reset(1)
            with only(XCP.send) as bus:
                calibrated(XcpOnABus(bus))
            ecu.terminate()
            assert ecu.wait(20) == 0
        finally:
            ecu.kill()


def only(word):
    """The bus with the frames of one identifier."""
    mine = {"can_id": word & EXTENDED_MASK, "can_mask": EXTENDED_MASK, "extended": True}
    return can.Bus(interface="socketcan", channel=INTERFACE, can_filters=[mine])


class XcpOnABus:
    """Commands and answers of XCP on a bus with other traffic."""

    def __init__(self, bus):
        self._bus = bus

    def ask(self, packet):
        receive, send = (word & EXTENDED_MASK for word in (XCP.receive, XCP.send))
        self._bus.send(can.Message(arbitration_id=receive, data=packet, is_extended_id=True))
        while (message := self._bus.recv(20)) is not None:
            if message.arbitration_id == send:
                return bytes(message.data)
        raise AssertionError(f"no answer to {packet.hex()}")


def calibrated(tool):
    number = next(n for n in calibration_numbers() if n.name == "bucket.mass_kg")
    assert tool.ask(b"\xff\x00")[:2] == b"\xff\x05"
    place, write = struct.pack("<BHBI", 0xF6, 0, 0, number.address), b"\xf0\x04" + struct.pack("<f", 900.0)
    assert tool.ask(place) == b"\xff"
    assert tool.ask(write) == b"\xfe\x25"
    seed = b"".join(tool.ask(bytes((0xF8, mode, 1)))[2:] for mode in (0, 1))
    key = key_of(SECRET, CALIBRATE, seed)
    for at in range(0, len(key), 6):
        tool.ask(bytes((0xF7, len(key) - at)) + key[at : at + 6])
    assert tool.ask(write) == b"\xff"
    assert tool.ask(struct.pack("<BBBBI", 0xF4, 4, 0, 0, number.address))[1:] == struct.pack("<f", 900.0)
