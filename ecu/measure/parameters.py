"""The table of the calibration's numbers: names, units, ranges, addresses, and which may change while the ECU runs."""

import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

from ecu.calibration import QUANTITIES
from ecu.quantity import Quantity

BASE: Final = 0x0001_0000
"""Address of the first number; each takes four bytes, a float32 in the unit of its key."""
SIZE: Final = 4

FIXED_SECTIONS: Final = frozenset(
    {"geometry", "inputs", *(s for s in QUANTITIES if s.startswith(("detection", "sensor_")))}
)
"""Sections from which tables are built at the start: plausibility of the inputs, tracks, the test of sensors."""
FIXED_NAMES: Final = frozenset({"wheel.unloaded_radius_m"})
"""Single numbers of other sections of which the same is true."""


@dataclass(frozen=True, slots=True)
class CalibrationNumber:
    """One number of a calibration file."""

    section: str
    quantity: Quantity
    address: int

    @property
    def key(self) -> str:
        """The key in its section, with the unit."""
        return self.quantity.key

    @property
    def name(self) -> str:
        """SECTION.KEY, as in messages about the file."""
        return f"{self.section}.{self.quantity.key}"

    @property
    def adjustable(self) -> bool:
        """Whether it may change while the ECU runs."""
        return self.section not in FIXED_SECTIONS and self.name not in FIXED_NAMES


@lru_cache(maxsize=1)
def calibration_numbers() -> tuple[CalibrationNumber, ...]:
    """All numbers in the order of their addresses."""
    found = [(section, quantity) for section, quantities in QUANTITIES.items() for quantity in quantities]
    return tuple(CalibrationNumber(s, q, BASE + SIZE * k) for k, (s, q) in enumerate(found))


def image_of(sections: Mapping[str, object]) -> bytes:
    """The numbers of a calibration's table that has been checked, as they lie in memory: float32, in the order of their addresses."""
    numbers = [float(sections[row.section][row.key]) for row in calibration_numbers()]  # type: ignore[index]
    return struct.pack(f"<{len(numbers)}f", *numbers)


def layout_checksum(*names: str) -> int:
    """CRC-32 of names in the order of their addresses: an A2L file fits an ECU that has the same."""
    return zlib.crc32("\n".join(names).encode())
