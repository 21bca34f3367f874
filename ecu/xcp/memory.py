"""What XCP addresses mean: the version text, the calibration pages and the measurements of the last cycle."""

import zlib
from typing import Final

from ecu.measure import measurements as measured
from ecu.measure import parameters
from ecu.measure.measurements import MeasuredImage, measurements
from ecu.measure.pages import REFERENCE, WORKING, CalibrationPages, NotAdjustable, OutOfRange
from ecu.measure.parameters import calibration_numbers, layout_checksum
from ecu.xcp.packets import Error, Refused

EPK_ADDRESS: Final = 0x0000_1000


def epk() -> bytes:
    """The text by which a tool sees that an A2L file fits this ECU: it changes with every address."""
    names = (*(n.name for n in calibration_numbers()), *(f"{m.name} {m.type}" for m in measurements()))
    return f"loaderhil {layout_checksum(*names):08x}".encode()


class Memory:
    """The address space of one ECU; extension 0 only."""

    def __init__(self, pages: CalibrationPages, image: MeasuredImage) -> None:
        self.pages, self.image = pages, image
        self._epk = epk()
        self.page = WORKING  # the page that the tool reads and writes

    @property
    def calibration_area(self) -> tuple[int, int]:
        """Address and size of the calibration."""
        return parameters.BASE, self.pages.size

    def read(self, address: int, extension: int, size: int) -> bytes:
        """`size` bytes, all of them inside one area. Raises Refused(ACCESS_DENIED)."""
        if extension == 0:
            for base, length in self._areas():
                if base <= address and address + size <= base + length:
                    return self._bytes(base, address - base, size)
        raise Refused(Error.ACCESS_DENIED)

    def _areas(self) -> tuple[tuple[int, int], ...]:
        return (
            (measured.BASE, self.image.size),
            self.calibration_area,
            (EPK_ADDRESS, len(self._epk)),
        )

    def _bytes(self, base: int, offset: int, size: int) -> bytes:
        if base == measured.BASE:
            return self.image.bytes()[offset : offset + size]
        if base == parameters.BASE:
            return self.pages.read(self.page, offset, size)
        return self._epk[offset : offset + size]

    def measured_bytes(self, address: int, extension: int, size: int) -> int:
        """The offset of measured bytes in the image of a cycle. Raises Refused(ACCESS_DENIED) for other memory."""
        offset = address - measured.BASE
        if extension or not 0 <= offset <= self.image.size - size:
            raise Refused(Error.ACCESS_DENIED)
        return offset

    def write(self, address: int, extension: int, data: bytes) -> None:
        """Write calibration data. Raises Refused with the reason as the standard's code."""
        offset = address - parameters.BASE
        if extension or not 0 <= offset <= self.pages.size - len(data):
            raise Refused(Error.ACCESS_DENIED)
        if self.page == REFERENCE:
            raise Refused(Error.WRITE_PROTECTED)
        try:
            self.pages.write(offset, data)
        except NotAdjustable:
            raise Refused(Error.WRITE_PROTECTED) from None
        except OutOfRange:
            raise Refused(Error.OUT_OF_RANGE) from None

    def checksum(self, address: int, extension: int, size: int) -> int:
        """CRC-32 (IEEE 802.3) of a block."""
        return zlib.crc32(self.read(address, extension, size))
