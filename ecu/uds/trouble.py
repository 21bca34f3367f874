"""ReadDTCInformation: the ECU's trouble codes with status, freeze frames and counts.

A DTC has the format of SAE J1939-73 (DTC format identifier 0x02): 19 bits of SPN and 5 of FMI in three bytes, as in DM1.
"""

import struct
from collections.abc import Callable, Iterable, Iterator
from typing import Final

from ecu.codes import FreezeFrame, Mode, TroubleCode, TroubleCodes
from ecu.uds.codes import KEPT, Negative, Refused, Status

FORMAT_J1939: Final = 0x02
ALL_CODES: Final = 0xFF_FFFF
RECORD: Final = 0x01
"""A code has one freeze frame, that of its last beginning, and one record of extended data: the count."""
ANY_RECORD: Final = 0xFF
SNAPSHOT_BASE: Final = 0x0100
"""Identifier of the first value of a freeze frame; they are numbered in the order of `FreezeFrame`."""
LARGEST: Final = 3.4e38


def number(spn: int, mode: Mode) -> bytes:
    """The three bytes of a code."""
    return bytes((spn & 0xFF, spn >> 8 & 0xFF, spn >> 16 << 5 | mode))


def status(code: TroubleCode) -> int:
    """Codes live from the start of the ECU on, so that all but the first bit say the same."""
    active = Status.TEST_FAILED if code.active else Status(0)
    return int(active | Status.FAILED_THIS_CYCLE | Status.CONFIRMED | Status.FAILED_SINCE_CLEAR)


class TroubleReader:
    """Answers ReadDTCInformation from the ECU's codes."""

    def __init__(self, codes: Callable[[], TroubleCodes]) -> None:
        self._codes = codes
        self._reports: dict[int, Callable[[bytes], bytes]] = {
            0x01: self._count,
            0x02: self._by_mask,
            0x03: self._snapshots,
            0x04: self._snapshot,
            0x06: self._extended,
            0x0A: self._supported,
        }

    def report(self, request: bytes) -> bytes:
        """What follows the service's answer byte; request: from the sub-function on. Raises Refused."""
        kind = request[0] & 0x7F
        if kind not in self._reports:
            raise Refused(Negative.SUBFUNCTION_NOT_SUPPORTED)
        return bytes((kind,)) + self._reports[kind](request[1:])

    def _kept(self) -> Iterable[TroubleCode]:
        codes = self._codes()
        return (*codes.active, *codes.previous)

    def _matching(self, mask: int) -> Iterator[TroubleCode]:
        return (code for code in self._kept() if status(code) & mask)

    def _count(self, rest: bytes) -> bytes:
        count = sum(1 for _ in self._matching(*_bytes(rest, 1)))
        return struct.pack(">BBH", KEPT, FORMAT_J1939, count)

    def _by_mask(self, rest: bytes) -> bytes:
        found = self._matching(*_bytes(rest, 1))
        return bytes((KEPT,)) + b"".join(number(c.spn, c.mode) + bytes((status(c),)) for c in found)

    def _supported(self, rest: bytes) -> bytes:
        _bytes(rest, 0)
        kept = {(code.spn, code.mode): status(code) for code in self._kept()}
        pairs = self._codes().possible()
        return bytes((KEPT,)) + b"".join(number(*pair) + bytes((kept.get(pair, 0),)) for pair in pairs)

    def _snapshots(self, rest: bytes) -> bytes:
        _bytes(rest, 0)
        return b"".join(number(code.spn, code.mode) + bytes((RECORD,)) for code in self._kept())

    def _snapshot(self, rest: bytes) -> bytes:
        code = self._named(rest)
        head = number(code.spn, code.mode) + bytes((status(code), RECORD, len(FreezeFrame._fields)))
        # beyond single precision there is no number to pack
        frozen = (min(max(value, -LARGEST), LARGEST) for value in code.frozen)
        values = (struct.pack(">Hf", SNAPSHOT_BASE + k, value) for k, value in enumerate(frozen))
        return head + b"".join(values)

    def _extended(self, rest: bytes) -> bytes:
        code = self._named(rest)
        head = number(code.spn, code.mode) + bytes((status(code), RECORD))
        return head + bytes((code.occurrences,))

    def _named(self, rest: bytes) -> TroubleCode:
        """The code and record of a request; OUT_OF_RANGE where there is none."""
        *wanted, record = _bytes(rest, 4)
        for code in self._kept():
            if number(code.spn, code.mode) == bytes(wanted) and record in (RECORD, ANY_RECORD):
                return code
        raise Refused(Negative.OUT_OF_RANGE)


def _bytes(rest: bytes, count: int) -> tuple[int, ...]:
    if len(rest) != count:
        raise Refused(Negative.WRONG_LENGTH)
    return tuple(rest)
