"""End-to-end protection of frames: AUTOSAR E2E profile 1, as the DBC's attributes ask for it.

Byte 0 is the CRC-8 (SAE J1850) over data id and payload, the low nibble of byte 1 a counter
0..14. The receiver's counter check is ours, not AUTOSAR's: with the message's cycle time it
distinguishes lost, repeated, late and restarted frames as far as 15 counter values allow.

The CRC is linear, so a random corruption looks like the frame of one of n other data ids
with probability n/255: MASQUERADED is certain only when it repeats.
"""

import enum
from typing import Final, Self

from e2e.p01 import E2E_P01_DATAID_BOTH, e2e_p01_protect

from dbc.database import MessageCodec

COUNTERS: Final = 15  # counter values; 15 itself is never sent
_INVALID: Final = 15
_MOST_LOST: Final = 7  # a jump of more than half the circle is a step back


class Finding(enum.Enum):
    """What the check of one frame found; `usable` says whether its content may be used."""

    OK = "ok", True
    INITIAL = "first frame, counter unknown", True
    LOST = "frames lost before this one", True
    RESTARTED = "counter jumped and goes on from there", True
    REPEATED = "counter repeated"
    REORDERED = "older than the previous frame"
    WRONG_COUNTER = "counter 15 is never sent"
    WRONG_CRC = "wrong CRC"
    MASQUERADED = "CRC is that of another message"
    WRONG_LENGTH = "wrong length"

    usable: bool

    def __new__(cls, words: str, usable: bool = False) -> Self:
        """usable: whether the frame is intact and newer than the one before."""
        finding = object.__new__(cls)
        finding._value_ = words
        finding.usable = usable
        return finding


def _data_id(codec: MessageCodec) -> int:
    if codec.e2e_data_id is None:
        raise ValueError(
            f"{codec.name} carries no end-to-end protection: its DBC attribute E2EProfile is 'none'"
        )
    return codec.e2e_data_id


class Protector:
    """Sender's side of one message: counts and signs."""

    def __init__(self, codec: MessageCodec, counter: int = 0) -> None:
        self._data_id = _data_id(codec)
        self._counter = counter % COUNTERS

    def protect(self, data: bytes) -> bytes:
        """The same frame with counter and CRC set."""
        frame = bytearray(data)
        frame[1] = frame[1] & 0xF0 | self._counter
        self._counter = (self._counter + 1) % COUNTERS
        sign(frame, self._data_id)
        return bytes(frame)


def sign(frame: bytearray, data_id: int) -> None:
    """Set the CRC, leaving the counter as it is."""
    e2e_p01_protect(frame, data_id, data_id_mode=E2E_P01_DATAID_BOTH, increment_counter=False)


def _is_signed(data: bytes, data_id: int) -> bool:
    """Whether the CRC is right, whatever the counter (e2e_p01_check fails counter 15 as if its CRC were wrong)."""
    expected = bytearray(data)
    sign(expected, data_id)
    return expected[0] == data[0]


class Checker:
    """Receiver's side of one message.

    After each check: `lost` is how many frames are missing before this one (0 unless LOST),
    `claimed` the message whose data id fits a masqueraded frame.
    """

    def __init__(self, codec: MessageCodec) -> None:
        self._data_id = _data_id(codec)
        self._neighbours = codec.neighbour_data_ids
        self._length = codec.length
        self._cycle_ns = codec.cycle_ns
        self._counter: int | None = None  # of the newest frame accepted
        self._heard_ns = 0  # when a frame with a good CRC last came
        self._stale_counter: int | None = None  # of the previous frame, if that was REORDERED
        self.lost = 0
        self.claimed = ""

    def check(self, data: bytes, now_ns: int) -> Finding:
        """Judge one received frame."""
        self.lost, self.claimed = 0, ""
        if len(data) != self._length:
            return Finding.WRONG_LENGTH
        if not _is_signed(data, self._data_id):
            return self._foreign(data)
        counter = data[1] & 0x0F
        if counter == _INVALID:
            return Finding.WRONG_COUNTER
        finding = self._judge(counter, now_ns)
        self._heard_ns = now_ns
        self._stale_counter = counter if finding is Finding.REORDERED else None
        if finding.usable:
            self._counter = counter
        return finding

    def _foreign(self, data: bytes) -> Finding:
        for data_id, name in self._neighbours.items():
            if _is_signed(data, data_id):
                self.claimed = name
                return Finding.MASQUERADED
        return Finding.WRONG_CRC

    def _judge(self, counter: int, now_ns: int) -> Finding:
        """Place the counter on its circle of 15, with the time passed to say how often it went round."""
        if self._counter is None:
            return Finding.INITIAL
        step = (counter - self._counter) % COUNTERS
        cycles = (now_ns - self._heard_ns) / self._cycle_ns if self._cycle_ns else 0.0
        missed = round((cycles - step) / COUNTERS) * COUNTERS + step - 1
        if step == 1 and (missed <= 0 or abs(cycles - 1 - missed) > 1.0):
            return Finding.OK  # also after a pause, unless that was whole turns of the counter
        if missed > _MOST_LOST or 1 < step <= _MOST_LOST + 1:
            self.lost = max(missed, step - 1)
            return Finding.LOST
        if self._goes_on_from_stale(counter) and cycles > 0.5:
            return Finding.RESTARTED
        return Finding.REPEATED if step == 0 else Finding.REORDERED

    def _goes_on_from_stale(self, counter: int) -> bool:
        """Whether the previous frame was a step back and this one follows it."""
        return self._stale_counter is not None and (counter - self._stale_counter) % COUNTERS == 1
