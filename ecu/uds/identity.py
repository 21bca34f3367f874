"""What ReadDataByIdentifier reads: who the ECU is, and everything that can be measured. Numbers are big-endian float32 or a byte."""

import struct
import zlib
from collections.abc import Callable, Mapping
from typing import Final

from ecu.cycle import EcuCycle
from ecu.measure.measurements import BASE, FLOAT, MeasuredImage, measurements
from ecu.measure.parameters import image_of
from ecu.states import State

MACHINE, SOFTWARE_VERSION, CALIBRATION_NAME, CALIBRATION_CHECKSUM = 0xF190, 0xF195, 0xF1A0, 0xF1A1
MEASURED_BASE: Final = 0x1000
"""Identifier of the first measurement; they are numbered in the order of the A2L file."""
VIN_LENGTH: Final = 17


def identifiers(
    cycle: EcuCycle, sections: Mapping[str, object], version: str
) -> dict[int, Callable[[], bytes]]:
    """Readers by identifier. sections: the table of the calibration's file; version: of the software."""
    name = cycle.calibration.name
    # what XCP's BUILD_CHECKSUM gives of page 0
    checksum = struct.pack(">I", zlib.crc32(image_of(sections)))
    found: dict[int, Callable[[], bytes]] = {
        MACHINE: lambda: machine_name(name),
        SOFTWARE_VERSION: lambda: version.encode(),
        CALIBRATION_NAME: lambda: name.encode(),
        CALIBRATION_CHECKSUM: lambda: checksum,
    }
    image = MeasuredImage(cycle)
    for k, row in enumerate(measurements()):
        found[MEASURED_BASE + k] = _reader(image, row.address - BASE, row.type == FLOAT)
    return found


def machine_name(calibration: str) -> bytes:
    """Name of the machine with the length of a VIN."""
    return f"LOADERHIL{calibration.upper()}".ljust(VIN_LENGTH, "0")[:VIN_LENGTH].encode()


def _reader(image: MeasuredImage, offset: int, is_float: bool) -> Callable[[], bytes]:
    size = 4 if is_float else 1
    # UDS is big-endian, the image of the tools is not
    return lambda: image.bytes()[offset : offset + size][::-1]


def self_test(cycle: EcuCycle) -> Callable[[], bytes]:
    """The routine: 0 or 1 (failed), state, active trouble codes, skipped cycles since the start (two bytes)."""

    def run() -> bytes:
        active = min(len(cycle.trouble_codes.active), 255)
        failed = active > 0 or cycle.state is not State.RUNNING
        return struct.pack(">BBBH", failed, cycle.state, active, int(cycle.values.get("overruns", 0.0)))

    return run
