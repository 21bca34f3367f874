"""SAE J1939 identifiers: priority, parameter group number (PGN), addresses (J1939-21, 5.2)."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Identifier = TypeVar("Identifier", int, NDArray[np.int64])

_PDU2 = 240  # PDU formats from here on are broadcast: PDU specific belongs to the PGN


def pgn(can_id: int) -> int:
    """Parameter group number of a 29-bit identifier (flags of a `can_id` word are ignored)."""
    # extended data page, data page, PDU format and PDU specific: 18 bits above the source address
    number = can_id >> 8 & 0x3FFFF
    # below PDU format 240 the low byte is a destination address, which is no part of the group number
    return number if number >> 8 & 0xFF >= _PDU2 else number & 0x3FF00


def source_address(can_id: Identifier) -> Identifier:
    """Address of the sender; of one identifier, or of each in an array."""
    return can_id & 0xFF


def priority(can_id: int) -> int:
    """Priority, 0 (first) to 7."""
    return can_id >> 26 & 7
