"""Checks CRC and counter of E2E profile 1 in all frames of one message in one compiled call.

The CRC is CRC-8 SAE J1850 over the data id, as its mode says, and over the payload behind the CRC byte
(AUTOSAR PRS_E2EProtocol, profile 1).
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from dbc.compiled import released
from dbc.protections import COUNTERS, Profile1

POLYNOMIAL: Final = 0x1D
"""Of CRC-8 SAE J1850."""
INTACT, WRONG_CRC, COUNTER_NEVER_SENT = range(3)


def _table() -> NDArray[np.uint8]:
    """The CRC of each byte."""
    crc = np.arange(256)
    for _ in range(8):
        crc = np.where(crc & 0x80, crc << 1 ^ POLYNOMIAL, crc << 1) & 0xFF
    return crc.astype(np.uint8)


CRC_TABLE: Final = _table()
"""CRC after one more byte, at the CRC before exclusive-or the byte."""


def _begins(profile: Profile1) -> tuple[np.uint8, np.uint8]:
    """The CRC over the data id, for frames with an even and with an odd counter."""
    low, high = profile.data_id & 0xFF, profile.data_id >> 8 & 0xFF
    of_low = int(CRC_TABLE[low])
    if profile.mode == "alternating":
        return CRC_TABLE[low], CRC_TABLE[high]
    # mode nibble sends half of the high byte in the frame, and counts a zero in its place
    second = {"both": high, "nibble": 0}.get(profile.mode)
    begin = CRC_TABLE[low] if second is None else CRC_TABLE[of_low ^ second]
    return begin, begin


def check_profile1(
    profile: Profile1, data: NDArray[np.uint8], rows: NDArray[np.int64], length: int
) -> NDArray[np.uint8]:
    """Of each frame in `rows` INTACT, WRONG_CRC or COUNTER_NEVER_SENT, (n,); length: bytes of the message."""
    found = np.empty(rows.size, np.uint8)
    even, odd = _begins(profile)
    check_frames(data, rows, length, even, odd, CRC_TABLE, found)
    return found


@released
def check_frames(data: Any, rows: Any, length: Any, even: Any, odd: Any, table: Any, found: Any) -> None:
    """Write what each frame is into `found`."""
    for i in range(rows.size):
        row = rows[i]
        counter = data[row, 1] & 0x0F
        crc = odd if counter & 1 else even
        for place in range(1, length):
            crc = table[crc ^ data[row, place]]
        if crc != data[row, 0]:
            found[i] = WRONG_CRC
        elif counter >= COUNTERS:
            found[i] = COUNTER_NEVER_SENT
        else:
            found[i] = INTACT
