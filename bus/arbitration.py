"""CSMA/CR arbitration of one CAN wire, for the hub with a bit rate. A pure model: no clock, no input or output.

Stations queue frames; while the wire is free the first frame of each competes, the lowest
identifier wins, and nothing interrupts it. A station sends its own frames in the order
given, as controllers with a transmit queue do. A frame has arrived with its last bit.
"""

from collections import deque
from collections.abc import Hashable
from dataclasses import dataclass
from typing import Generic, TypeVar

from bus.bits import duration_ns
from bus.frame import ERROR, EXTENDED, EXTENDED_MASK, REMOTE, STANDARD_MASK, Frame


def priority(can_id: int) -> int:
    """The bits of the arbitration field in the order sent; the smaller wins the bus.

    Base identifier, RTR (SRR if extended), IDE, rest of the identifier, RTR: a standard
    frame beats an extended one with the same base, and data beat a remote request.
    """
    if can_id & ERROR:
        # an error flag violates bit stuffing, so it overrides every frame: before all of them
        return -1
    remote = int(bool(can_id & REMOTE))
    if can_id & EXTENDED:
        identifier = can_id & EXTENDED_MASK
        # 0b11: SRR and IDE are recessive in an extended frame; both are sent after the eleven base bits
        return (identifier >> 18) << 21 | 0b11 << 19 | (identifier & 0x3FFFF) << 1 | remote
    return (can_id & STANDARD_MASK) << 21 | remote << 20


Station = TypeVar("Station", bound=Hashable)


@dataclass(slots=True)
class _Transmission(Generic[Station]):
    station: Station
    frame: Frame
    end_ns: int  # when the last bit of the frame has been sent


class Arbiter(Generic[Station]):
    """Takes frames in the order of time; returns (station, frame stamped with the time of its last bit)."""

    def __init__(self, bit_rate: int, data_bit_rate: int | None = None) -> None:
        """Rates in bit/s; the data rate is that of CAN FD frames with a bit-rate switch."""
        for name, rate in (("bit_rate", bit_rate), ("data_bit_rate", data_bit_rate)):
            if rate is not None and not 5_000 <= rate <= 20_000_000:
                raise ValueError(
                    f"{name}={rate} bit/s is outside 5000 to 20000000: CAN usually runs at 250000 or 500000"
                )
        # wide limits that only catch a wrong unit (500 for 500 kbit/s); 20 Mbit/s is CAN XL's fastest data phase
        self.bit_rate = bit_rate
        # total time [ns] that frames have occupied the wire; the hub's status derives the bus load from it
        self.busy_ns = 0
        self._data_bit_rate = data_bit_rate
        self._queues: dict[Station, deque[Frame]] = {}
        self._sending: _Transmission[Station] | None = None

    @property
    def due_ns(self) -> int | None:
        """When the frame on the wire ends; None while the wire is idle."""
        return self._sending.end_ns if self._sending else None

    def waiting(self, station: Station) -> int:
        """Frames of a station that have not won the wire yet."""
        return len(self._queues.get(station, ()))

    def offer(self, station: Station, frame: Frame, now_ns: int) -> list[tuple[Station, Frame]]:
        """Queue a frame; what has arrived by `now_ns`, which may not run backwards."""
        arrived = self.advance(now_ns)
        self._queues.setdefault(station, deque()).append(frame)
        if self._sending is None:
            self._start(now_ns)
        return arrived

    def advance(self, now_ns: int) -> list[tuple[Station, Frame]]:
        """What has arrived by `now_ns`, oldest first."""
        arrived = []
        while self._sending and self._sending.end_ns <= now_ns:
            done = self._sending
            arrived.append((done.station, done.frame._replace(at_ns=done.end_ns)))
            # the next frame starts where this one ended, not at now_ns: a caller that looks late loses no bus time
            self._start(done.end_ns)
        return arrived

    def _start(self, now_ns: int) -> None:
        """Let the winner of the arbitration at `now_ns` begin."""
        self._sending = None
        if not self._queues:
            return
        # equal identifiers from two stations are an error on a real bus; here the station that queued first wins
        station = min(self._queues, key=lambda station: priority(self._queues[station][0].can_id))
        queue = self._queues[station]
        frame = queue.popleft()
        if not queue:
            del self._queues[station]
        length_ns = duration_ns(frame, self.bit_rate, self._data_bit_rate)
        self.busy_ns += length_ns
        self._sending = _Transmission(station, frame, now_ns + length_ns)
