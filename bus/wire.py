"""The modelled bus of a lockstep run: computes when a frame arrives, by arbitration and frame length.

Classic CAN at a constant bit rate. A frame occupies the wire for its nominal length
without stuff bits (ISO 11898-1: 47 bits of frame and interframe space with an 11-bit
identifier, 67 with a 29-bit one, and 8 per data byte); stuffing would add 0..23 %.
Frames of both sides queue together and the lowest identifier goes first, as with
controllers that have a mailbox per message. So the order and the age of the values that each
side reads are those of a real bus. (bus.arbitration counts the exact stuff bits, which would
cost more than a whole lockstep tick.)
"""

from collections.abc import Iterable
from operator import itemgetter
from typing import Protocol

from bus.arbitration import priority
from bus.frame import EXTENDED, Frame

SECOND = 1_000_000_000
_priority = itemgetter(0)
_made = tuple.__new__


def wire_bits(frame: Frame) -> int:
    """Bits that a classic frame occupies, interframe space included, stuff bits not."""
    return (67 if frame.can_id & EXTENDED else 47) + 8 * len(frame.data)


class Carrier(Protocol):
    """What lockstep needs of a wire: `Wire`, or one on which faults are injected."""

    def put(self, frames: Iterable[Frame], now_ns: int, sender: str) -> None: ...

    def take(self, until_ns: int) -> list[tuple[str, Frame]]: ...


class Wire:
    """Frames in, the same frames out with their sender and the stamp of their last bit."""

    def __init__(self, bit_rate: int = 500_000) -> None:
        if bit_rate <= 0:
            raise ValueError(
                f"bit_rate={bit_rate} bit/s is not positive; CAN runs at 10_000 to 1_000_000 bit/s"
            )
        self._bit_ns = SECOND / bit_rate
        self._pending: list[tuple[int, int, str, Frame]] = []  # priority, duration [ns], sender, frame
        # (can_id, length) -> priority, duration [ns]
        self._known: dict[tuple[int, int], tuple[int, int]] = {}
        self._free_ns = 0  # when the wire is free again

    def put(self, frames: Iterable[Frame], now_ns: int, sender: str) -> None:
        """Queue frames at `now_ns`; the wire cannot have carried them before that."""
        known, queue = self._known, self._pending.append
        for frame in frames:
            kind = frame[0], len(frame[1])
            try:
                first, duration_ns = known[kind]
            except KeyError:
                first, duration_ns = priority(frame.can_id), round(wire_bits(frame) * self._bit_ns)
                known[kind] = first, duration_ns
            queue((first, duration_ns, sender, frame))
        self._pending.sort(key=_priority)  # stable: equal identifiers keep their order
        self._free_ns = max(self._free_ns, now_ns)

    def take(self, until_ns: int) -> list[tuple[str, Frame]]:
        """(sender, frame) of what has arrived by `until_ns`, in order, stamped with the arrival."""
        arrived: list[tuple[str, Frame]] = []
        arrive, at_ns = arrived.append, self._free_ns
        for _, duration_ns, sender, (can_id, data, _, flags) in self._pending:
            end_ns = at_ns + duration_ns
            if end_ns > until_ns:
                break
            at_ns = end_ns
            # not by Frame(...): twenty times per tick, half of the time of making one is the call
            arrive((sender, _made(Frame, (can_id, data, at_ns, flags))))
        del self._pending[: len(arrived)]
        self._free_ns = at_ns
        return arrived

    @property
    def backlog(self) -> int:
        """Frames still waiting."""
        return len(self._pending)
