"""Counter and checksum of a message: AUTOSAR E2E profile 1, or a hook of the user for what a DBC cannot describe.

A hook is an object with the methods of `Protection`, in a Python file that names one per message:

    PROTECTIONS = {"EngineData": MyChecksum()}

The same object serves the sender (rest bus) and every receiver (check, conform, monitor of a gateway).
"""

import runpy
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, Protocol, runtime_checkable

from e2e.crc import calculate_crc8
from e2e.p01 import (
    E2E_P01_DATAID_ALT,
    E2E_P01_DATAID_BOTH,
    E2E_P01_DATAID_LOW,
    E2E_P01_DATAID_NIBBLE,
    e2e_p01_protect,
)

from bus.user_error import UserError

COUNTERS: Final = 15
"""Counter values of E2E profile 1: 0 to 14; 15 itself is never sent."""
MODES: Final[Mapping[str, int]] = {
    "both": E2E_P01_DATAID_BOTH,
    "alternating": E2E_P01_DATAID_ALT,
    "low": E2E_P01_DATAID_LOW,
    "nibble": E2E_P01_DATAID_NIBBLE,
}
"""Values of the DBC's attribute E2EDataIdMode; AUTOSAR PRS_E2EProtocol, E2E_P01DataIDMode."""


class ProtectionError(UserError, ValueError):
    """A file of protections cannot be used; the message names it and what is missing."""


@runtime_checkable
class Protection(Protocol):
    """What sender and receivers need to know of one message's counter and checksum.

    counters: how many values the counter takes, from 0 on; 1 for a message without a counter.
    """

    counters: int

    def protect(self, data: bytes, counter: int) -> bytes:
        """The frame with this counter (0 .. counters - 1) and a right checksum; its length stays."""
        ...

    def intact(self, data: bytes) -> bool:
        """Whether the checksum of a frame of the message's length is right."""
        ...

    def counter(self, data: bytes) -> int:
        """The counter of an intact frame; a value from `counters` on is one that is never sent."""
        ...


class Profile1:
    """AUTOSAR E2E profile 1: CRC-8 SAE J1850 in byte 0, counter 0..14 in the low nibble of byte 1."""

    counters = COUNTERS

    def __init__(self, data_id: int, mode: str = "both") -> None:
        """mode: how the data id goes into the CRC, one of MODES. ValueError for another one."""
        if mode not in MODES:
            raise ValueError(f"E2EDataIdMode {mode!r} is none of {', '.join(MODES)}")
        self.data_id, self.mode = data_id, mode
        self._mode = MODES[mode]
        # the CRC goes over the data id first; where every frame has the same bytes of it, they are taken once
        same = {"both": data_id.to_bytes(2, "little"), "low": bytes([data_id & 0xFF])}.get(mode)
        self._begun = None if same is None else calculate_crc8(same, 0xFF, first_call=False)

    def protect(self, data: bytes, counter: int) -> bytes:
        """The frame with counter and CRC; in mode nibble also with four bits of the data id in byte 1."""
        frame = bytearray(data)
        # Mode nibble sends the low nibble of the id's high byte beside the counter, so that a receiver sees it.
        high = self.data_id >> 4 & 0xF0 if self.mode == "nibble" else frame[1] & 0xF0
        frame[1] = high | counter
        self.sign(frame)
        return bytes(frame)

    def sign(self, frame: bytearray) -> None:
        """Set the CRC, leaving the counter as it is."""
        e2e_p01_protect(frame, self.data_id, data_id_mode=self._mode, increment_counter=False)

    def intact(self, data: bytes) -> bool:
        """Whether the CRC is right, whatever the counter (e2e_p01_check fails counter 15 as if its CRC were wrong)."""
        if self._begun is not None:
            # the library's CRC ends with an inversion, that of the profile does not
            crc: int = calculate_crc8(data[1:], self._begun, False)  # by name it takes half as long again
            return crc ^ 0xFF == data[0]
        expected = bytearray(data)
        self.sign(expected)
        return expected[0] == data[0]

    def counter(self, data: bytes) -> int:
        """The low nibble of byte 1."""
        return data[1] & 0x0F


def read_protections(file: Path) -> dict[str, Protection]:
    """PROTECTIONS of a Python file: message name -> its protection. ProtectionError names what is wrong."""
    try:
        found: Any = runpy.run_path(str(file)).get("PROTECTIONS")
    except OSError as error:
        raise ProtectionError(f"{file}: cannot be read: {error.strerror or error}") from None
    except (Exception, SystemExit) as error:
        raise ProtectionError(f"{file}: {type(error).__name__}: {error}") from None
    if not isinstance(found, dict) or not found:
        raise ProtectionError(f"{file}: has no PROTECTIONS = {{'Message': protection}}")
    for name, each in found.items():
        missing = [n for n in ("counters", "protect", "intact", "counter") if not hasattr(each, n)]
        if missing:
            raise ProtectionError(f"{file}: the protection of {name} has no {' and no '.join(missing)}")
    return found
