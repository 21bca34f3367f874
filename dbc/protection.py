"""End-to-end protection of frames: sender and receiver of one message.

Counter and checksum are those of `dbc.protections`: AUTOSAR E2E profile 1 as the DBC's attributes ask for it, or a
user's hook. The receiver's counter check is ours, not AUTOSAR's: with the message's cycle time it
distinguishes lost, repeated, late and restarted frames as far as the counter's values allow.

The CRC is linear, so a random corruption looks like the frame of one of n other data ids
with probability n/255: MASQUERADED is certain only when it repeats.
"""

import enum
from typing import Self

from dbc.database import MessageCodec
from dbc.protections import COUNTERS, Profile1, Protection

__all__ = ["COUNTERS", "Checker", "Finding", "Protector", "sign"]


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


def _protection(codec: MessageCodec) -> Protection:
    if codec.protection is None:
        raise ValueError(
            f"{codec.name} carries no end-to-end protection: its DBC attribute E2EProfile is 'none'"
        )
    return codec.protection


class Protector:
    """Sender's side of one message: counts and signs."""

    def __init__(self, codec: MessageCodec, counter: int = 0) -> None:
        self._protection = _protection(codec)
        self._counter = counter % self._protection.counters

    def protect(self, data: bytes) -> bytes:
        """The same frame with counter and CRC set."""
        frame = self._protection.protect(data, self._counter)
        self._counter = (self._counter + 1) % self._protection.counters
        return frame


def sign(frame: bytearray, data_id: int) -> None:
    """Set the CRC of profile 1 over both bytes of the data id, leaving the counter as it is."""
    Profile1(data_id).sign(frame)


class Checker:
    """Receiver's side of one message.

    After each check: `lost` is how many frames are missing before this one (0 unless LOST),
    `claimed` the message whose data id fits a masqueraded frame.
    """

    def __init__(self, codec: MessageCodec) -> None:
        self._protection = _protection(codec)
        self._counters = self._protection.counters
        self._most_lost = (self._counters - 1) // 2  # a jump of more than half the circle is a step back
        self._neighbours = codec.neighbours
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
        if not self._protection.intact(data):
            return self._foreign(data)
        counter = self._protection.counter(data)
        if counter >= self._counters:
            return Finding.WRONG_COUNTER
        finding = self._judge(counter, now_ns)
        self._heard_ns = now_ns
        self._stale_counter = counter if finding is Finding.REORDERED else None
        if finding.usable:
            self._counter = counter
        return finding

    def _foreign(self, data: bytes) -> Finding:
        # only for broken frames: one checksum for each protected message of the database
        for name, neighbour in self._neighbours.items():
            if neighbour.intact(data):
                self.claimed = name
                return Finding.MASQUERADED
        return Finding.WRONG_CRC

    def _judge(self, counter: int, now_ns: int) -> Finding:
        """Place the counter on its circle, with the time passed to say how often it went round."""
        if self._counters < 2:
            return Finding.OK  # nothing counts
        if self._counter is None:
            return Finding.INITIAL
        # The counter alone gives the step modulo its number of values. The elapsed time, in cycles, gives the whole
        # turns: `missed` is the number of missing frames that fits both best.
        step = (counter - self._counter) % self._counters
        cycles = (now_ns - self._heard_ns) / self._cycle_ns if self._cycle_ns else 0.0
        if step == 1 and cycles < 2.0:
            return Finding.OK  # what follows says so too, as nothing is missing; nearly every frame ends here
        missed = round((cycles - step) / self._counters) * self._counters + step - 1
        if step == 1 and (missed <= 0 or abs(cycles - 1 - missed) > 1.0):
            # also after a pause that is not whole turns of the counter: then nothing is known to be lost
            return Finding.OK
        if missed > self._most_lost or 1 < step <= self._most_lost + 1:
            self.lost = max(missed, step - 1)
            return Finding.LOST
        # two frames in sequence, both behind the last accepted one: the sender was restarted, not its frames delayed
        if self._goes_on_from_stale(counter) and cycles > 0.5:
            return Finding.RESTARTED
        return Finding.REPEATED if step == 0 else Finding.REORDERED

    def _goes_on_from_stale(self, counter: int) -> bool:
        """Whether the previous frame was a step back and this one follows it."""
        return self._stale_counter is not None and (counter - self._stale_counter) % self._counters == 1
