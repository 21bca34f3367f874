"""SAE J1939 identifiers: priority, parameter group number (PGN), addresses (J1939-21, 5.2), and all of it as text."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from bus.frame import ERROR, EXTENDED, EXTENDED_MASK, REMOTE

Identifier = TypeVar("Identifier", int, NDArray[np.int64])

_PDU2 = 240  # PDU formats from here on are broadcast: PDU specific belongs to the PGN

# Acronyms of common parameter groups, SAE J1939-71 and -73 and -21.
PGN_NAMES = {
    0: "TSC1", 1024: "XBR", 59392: "ACKM", 59904: "RQST", 60160: "TP.DT", 60416: "TP.CM", 60928: "AC",
    61184: "PropA", 61440: "ERC1", 61441: "EBC1", 61442: "ETC1", 61443: "EEC2", 61444: "EEC1",
    61445: "ETC2", 61449: "VDC2", 65132: "TCO1", 65134: "HRW", 65215: "EBC2", 65226: "DM1", 65227: "DM2",
    65247: "EEC3", 65253: "HOURS", 65254: "TD", 65257: "LFC", 65258: "VW", 65260: "VI", 65262: "ET1",
    65263: "EFL/P1", 65264: "PTO", 65265: "CCVS", 65266: "LFE", 65269: "AMB", 65270: "IC1", 65271: "VEP1",
    65276: "DD",
}  # fmt: skip


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


def identifier_text(can_id: int) -> str:
    """An identifier in hexadecimal, with the J1939 parameter group of a 29-bit one."""
    if can_id & ERROR:
        return f"error frame 0x{can_id & EXTENDED_MASK:08X}"
    kind = " (remote)" if can_id & REMOTE else ""
    if not can_id & EXTENDED:
        return f"0x{can_id & 0x7FF:03X}{kind}"
    group = pgn(can_id)
    name = PGN_NAMES.get(group) or ("PropB" if 65280 <= group <= 65535 else "")
    return f"0x{can_id & EXTENDED_MASK:08X} (PGN {group}{f' {name}' if name else ''}){kind}"
