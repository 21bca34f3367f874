"""The calibration as two pages: the reference page is the file, the working page can be written while the ECU runs.

A write is checked as the whole file would be, with all rules between its numbers, and changes nothing where the checks
refuse it. What has been written acts from the next cycle on, all of it at once.
"""

import copy

import numpy as np

from configuration import CheckedTable, ConfigurationError
from ecu.calibration import Calibration, reread
from ecu.cycle import EcuCycle
from ecu.measure.parameters import BASE, SIZE, calibration_numbers, image_of

REFERENCE, WORKING = 0, 1
MOST_DECIMALS = 22  # powers of ten up to here are exact in double precision


class NotAdjustable(Exception):
    """The number at this place is fixed while the ECU runs, or there is none."""


class OutOfRange(Exception):
    """The checks of a calibration file refuse the value; the message is theirs."""


class CalibrationPages:
    """The pages of one ECU, and which of them it works with."""

    def __init__(self, cycle: EcuCycle, table: CheckedTable) -> None:
        """table: that of the calibration with which the cycle was made."""
        self._cycle, self._file = cycle, table.file
        self._reference_table = copy.deepcopy(dict(table.values))
        self._reference = self._at_work = cycle.calibration
        self._numbers = calibration_numbers()
        self._images = {REFERENCE: bytearray(image_of(table.values))}
        self._adjustable = [n.adjustable for n in self._numbers]
        self.size = len(self._images[REFERENCE])
        self.active = WORKING  # the page that the ECU works with
        self.reset()

    @property
    def name(self) -> str:
        """Of the calibration."""
        return self._reference.name

    def reset(self) -> None:
        """Make the working page a copy of the reference page again."""
        self._images[WORKING] = bytearray(self._images[REFERENCE])
        self._table = copy.deepcopy(self._reference_table)
        self._working = self._reference
        self._staged: tuple[int, bytes] = (0, b"")

    def read(self, page: int, offset: int, size: int) -> bytes:
        """Bytes of a page."""
        return bytes(self._images[page][offset : offset + size])

    def image(self, page: int) -> bytes:
        """All bytes of a page."""
        return bytes(self._images[page])

    def write(self, offset: int, data: bytes) -> None:
        """Write into the working page. A number that comes in several pieces is taken when it is complete.

        Raises NotAdjustable or OutOfRange; what was complete before the refused number has been written.
        """
        start, incomplete = self._staged
        if incomplete and start + len(incomplete) == offset:
            offset, data = start, incomplete + data
        self._staged = (0, b"")
        if offset % SIZE:
            raise NotAdjustable(f"address {BASE + offset:#x} is not the begin of a number")
        if offset + len(data) > self.size:
            raise NotAdjustable(f"address {BASE + offset:#x}: beyond the calibration")
        while len(data) >= SIZE:
            self._write_number(offset // SIZE, data[:SIZE])
            offset, data = offset + SIZE, data[SIZE:]
        if data and not self._adjustable[offset // SIZE]:
            raise NotAdjustable(self._numbers[offset // SIZE].name)
        self._staged = (offset, data)

    def _write_number(self, place: int, data: bytes) -> None:
        number = self._numbers[place]
        if not self._adjustable[place]:
            raise NotAdjustable(number.name)
        section = self._table[number.section]
        assert isinstance(section, dict)
        before = section[number.key]
        section[number.key] = shortest_decimal(np.frombuffer(data, "<f4")[0])
        try:
            table = CheckedTable(self._table, file=self._file)
            self._working = reread(self._working, table, number.section)
        except ConfigurationError as error:
            section[number.key] = before
            raise OutOfRange(str(error)) from None
        self._images[WORKING][place * SIZE : (place + 1) * SIZE] = data

    def before_cycle(self) -> None:
        """Let the cycle work with what the active page holds now."""
        wanted: Calibration = self._working if self.active == WORKING else self._reference
        if wanted is not self._at_work:
            self._cycle.recalibrate(wanted)
            self._at_work = wanted


def shortest_decimal(number: np.float32) -> float:
    """The decimal with the fewest places that is this float32, 0.3 and not 0.30000001: a limit of a range is then within it.

    A number below 1e-13 stays as it is: it would need powers of ten that a double does not hold exactly,
    and the ECU in C could not come to the same double.
    """
    exact, power = float(number), 1.0
    for _ in range(MOST_DECIMALS + 1):
        shorter = float(np.rint(exact * power)) / power
        if np.float32(shorter) == number:
            return shorter
        power *= 10.0
    return exact
