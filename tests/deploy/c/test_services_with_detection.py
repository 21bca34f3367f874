"""XCP and UDS beside the detection of sensor faults: what is written moves its rules, what it finds is read, in C as in Python."""

import struct
from collections import Counter

import numpy as np
import pytest

from ecu.codes import Mode
from ecu.measure.measurements import measurements
from ecu.measure.parameters import calibration_numbers
from tests.deploy.c.beside import put_beside, services_library
from tests.deploy.c.random_drives import RandomDrive
from tests.deploy.c.test_calibrating import numbers_in_c, write
from tests.ecu.detection.test_detection import CALIBRATION, NoisyMachine, jump_of
from tests.ecu.uds.tool import CHANNEL as UDS
from tests.ecu.uds.tool import UdsEcu
from tests.ecu.xcp.tool import CHANNEL as XCP
from tests.ecu.xcp.tool import SECRET, Ecu

ONLY_DETECTED = {Mode.DRIFTED_HIGH, Mode.DRIFTED_LOW, Mode.ROOT_CAUSE_NOT_KNOWN}
"""Modes that no check of a single signal has."""
MOVING = (
    "front.mass_kg",
    "rear.mass_kg",
    "arm.mass_kg",
    "bucket.mass_kg",
    "wheel.radial_linear",
    "wheel.radial_quadratic",
    "wheel.slip_stiffness",
    "tilt_linkage.bore_mm",
    "arm.along_m",
)
"""Numbers by which residuals, their bounds or their noise move."""


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    return services_library(tmp_path_factory.mktemp("services"))


def calibrating(library):
    ecu = put_beside(Ecu(detect_faults=True), library, secret=SECRET, xcp=XCP, detect_faults=True)
    ecu.ask("ff00")
    ecu.unlock()
    return ecu


def modes_of(ecu):
    """Of the trouble codes since start."""
    codes = ecu.cycle.trouble_codes
    return Counter(code.mode for code in (*codes.active, *codes.previous))


@pytest.mark.parametrize("seed", range(2))
def test_numbers_written_in_a_wild_drive_change_what_is_detected_alike(library, seed):
    """Every few cycles another number; all frames of both cores, the trouble codes among them, are compared in every cycle."""
    ecu, rng, tick = calibrating(library), np.random.default_rng(seed), 0
    numbers = [number for number in calibration_numbers() if number.name in MOVING]
    assert len(numbers) == len(MOVING)
    thresholds, taken = set(), 0
    for frame, now in RandomDrive(CALIBRATION, seed).calls(12_000):
        if frame is not None:
            ecu.cycle.receive(frame, now)
            continue
        ecu.now_ns, tick = now, tick + 1
        if tick % 40 == 0:
            number = numbers[rng.integers(len(numbers))]
            packet = struct.pack("<BBBBI", 0xF4, 4, 0, 0, number.address)
            (before,) = struct.unpack("<f", ecu.ask(packet)[1:])
            taken += write(ecu, number, float(np.float32(before * rng.uniform(0.9, 1.1))))
        ecu.service.before_cycle(now)
        ecu.cycle.tick(now)
        ecu.service.after_cycle(now)
        if tick % 40 == 0:
            found, expected = numbers_in_c(ecu)
            assert found == expected
            thresholds.add(tuple(found["detection_rules"]))
    assert taken > 20
    assert len(thresholds) > 10
    assert modes_of(ecu).keys() & ONLY_DETECTED


def test_what_the_detection_replaces_is_what_a_tool_measures(library):
    """The yaw rate jumps: the estimators go on with its sample less the jump, and so does a measurement of the input."""
    ecu = calibrating(library)
    ecu.machine = NoisyMachine()
    ecu.cycles(250)
    size = 3.0 * jump_of(ecu.cycle, "yaw_rate")
    ecu.machine.wrong["yaw_rate"] = lambda value, tick: value + size
    place = next(row for row in measurements() if row.name == "input.yaw_rate")
    measured = []
    for _ in range(20):
        ecu.cycles(1)
        packet = struct.pack("<BBBBI", 0xF4, 4, 0, 0, place.address)
        measured.append(struct.unpack("<f", ecu.ask(packet)[1:])[0])
    assert max(map(abs, measured)) < size / 4.0
    assert Mode.RATE_OF_CHANGE in modes_of(ecu)


@pytest.mark.parametrize("name", ["wheel_speed_2", "lift_pressure", "roll"])
def test_a_drift_is_a_trouble_code_with_its_freeze_frame(library, name):
    """A slow drift is found by residuals alone; codes, freeze frames and counts are read before and after it ends."""
    ecu = put_beside(UdsEcu(detect_faults=True), library, secret=SECRET, uds=UDS, detect_faults=True)
    ecu.machine = NoisyMachine()
    ecu.cycles(250)
    assert reported(ecu) == b""
    start, slope = ecu.machine.tick, jump_of(ecu.cycle, name) / 100.0
    ecu.machine.wrong[name] = lambda value, tick: value + min(tick - start, 400) * slope
    ecu.cycles(500)
    codes = reported(ecu)
    assert modes_of(ecu).keys() & (ONLY_DETECTED | {Mode.RATE_OF_CHANGE})
    assert len(codes) == 4 * modes_of(ecu).total()
    for at in range(0, len(codes), 4):
        assert len(asked(ecu, b"\x19\x04" + codes[at : at + 3] + b"\x01")) > 20
        assert asked(ecu, b"\x19\x06" + codes[at : at + 3] + b"\x01")[-1] >= 1
    ecu.machine.wrong.clear()
    ecu.cycles(400)
    assert len(reported(ecu)) >= len(codes)


def reported(ecu):
    """Number and status of every trouble code."""
    return asked(ecu, b"\x19\x02\xff")[3:]


def asked(ecu, request):
    """The answer to a request of one frame, all its frames put together."""
    frames = ecu.answers(bytes((len(request),)) + request)
    first = frames[0]
    if first[0] >> 4 == 0:
        return first[1 : 1 + first[0]]
    length, data = (first[0] & 0x0F) << 8 | first[1], first[2:]
    data += b"".join(frame[1:] for frame in ecu.answers(b"\x30\x00\x00"))
    return data[:length]
