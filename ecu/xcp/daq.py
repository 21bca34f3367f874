"""Lists of measurements that the ECU sends by itself (DAQ), set up by the tool at run time.

All lists are sampled at the end of a cycle from one image of it: what a list sends is of one cycle. A list's first packet
carries the cycle's time in microseconds.
"""

import struct
from dataclasses import dataclass, field
from typing import Final

from ecu.xcp.memory import Memory
from ecu.xcp.packets import MAX_DTO, MOST_ODTS, Error, Refused

MOST_ENTRIES: Final = 1024
"""Entries of all lists together: more than there are measurements several times over."""
MOST_LISTS: Final = 64
EVENT_CYCLE: Final = 0
"""The only event channel: the end of a cycle."""
STIM, TIMESTAMP, PID_OFF, ALTERNATING = 0x02, 0x10, 0x20, 0x01
"""Bits of SET_DAQ_LIST_MODE."""
SELECTED, RUNNING = 0x01, 0x40
"""Bits of GET_DAQ_LIST_MODE."""
TIMESTAMP_BYTES: Final = 4


@dataclass(slots=True)
class Odt:
    """What one packet carries: places in the image, (offset, size) each; None: not written yet."""

    entries: list[tuple[int, int] | None] = field(default_factory=list)

    @property
    def size(self) -> int:
        """Bytes of data."""
        return sum(entry[1] for entry in self.entries if entry is not None)


@dataclass(slots=True)
class DaqList:
    """One list."""

    odts: list[Odt] = field(default_factory=list)
    timestamp: bool = False
    prescaler: int = 1
    selected: bool = False
    running: bool = False
    cycles: int = 0  # until the next one that is sent


class DaqLists:
    """All lists of one ECU."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory
        self.reset()

    @property
    def count(self) -> int:
        """Lists that exist."""
        return len(self._lists)

    @property
    def running(self) -> bool:
        """Whether a list is being sent."""
        return any(each.running for each in self._lists)

    def reset(self) -> None:
        """As after the start: no lists, and `free` has to come before new ones."""
        self.free()
        self._freed = False

    def free(self) -> None:
        """Remove all lists; running ones are stopped."""
        self._lists: list[DaqList] = []
        self._pointer: tuple[int, int, int] | None = None
        self._freed = True

    def allocate(self, count: int) -> None:
        """Make lists; `free` has to be called before."""
        if not self._freed or self._lists:
            raise Refused(Error.SEQUENCE)
        if count > MOST_LISTS:
            raise Refused(Error.MEMORY_OVERFLOW)
        self._lists = [DaqList() for _ in range(count)]

    def allocate_odts(self, number: int, count: int) -> None:
        """Give a list its packets; all lists before the first entry of any."""
        daq = self._stopped(number)
        if daq.odts or any(odt.entries for each in self._lists for odt in each.odts):
            raise Refused(Error.SEQUENCE)
        if sum(len(each.odts) for each in self._lists) + count > MOST_ODTS:
            raise Refused(Error.MEMORY_OVERFLOW)
        daq.odts = [Odt() for _ in range(count)]

    def allocate_entries(self, number: int, odt: int, count: int) -> None:
        """Give a packet its entries."""
        daq = self._stopped(number)
        if odt >= len(daq.odts):
            raise Refused(Error.OUT_OF_RANGE)
        if daq.odts[odt].entries:
            raise Refused(Error.SEQUENCE)
        taken = sum(len(each.entries) for one in self._lists for each in one.odts)
        if taken + count > MOST_ENTRIES or count > MAX_DTO - 1:
            raise Refused(Error.MEMORY_OVERFLOW)
        daq.odts[odt].entries = [None] * count

    def point_to(self, number: int, odt: int, entry: int) -> None:
        """The entry that the next `write` fills."""
        daq = self._stopped(number)
        if odt >= len(daq.odts) or entry >= len(daq.odts[odt].entries):
            raise Refused(Error.OUT_OF_RANGE)
        self._pointer = (number, odt, entry)

    def write(self, bit_offset: int, size: int, extension: int, address: int) -> None:
        """Fill the entry that is pointed to, and point to the next one of its packet."""
        if self._pointer is None:
            raise Refused(Error.SEQUENCE)
        number, place, entry = self._pointer
        odt = self._stopped(number).odts[place]
        if bit_offset != 0xFF:
            raise Refused(Error.OUT_OF_RANGE)  # single bits are not offered
        before = odt.entries[entry]
        left = MAX_DTO - 1 - odt.size + (before[1] if before else 0)
        if not 1 <= size <= left:
            raise Refused(Error.DAQ_CONFIG)
        odt.entries[entry] = (self._memory.measured_bytes(address, extension, size), size)
        self._pointer = (number, place, entry + 1) if entry + 1 < len(odt.entries) else None

    def clear(self, number: int) -> None:
        """Stop a list and empty its entries."""
        daq = self._list(number)
        daq.running = daq.selected = False
        for odt in daq.odts:
            odt.entries = [None] * len(odt.entries)

    def set_mode(self, mode: int, number: int, event: int, prescaler: int, priority: int) -> None:
        """Set timestamp and prescaler of a list."""
        daq = self._stopped(number)
        if mode & (STIM | PID_OFF | ALTERNATING):
            raise Refused(Error.MODE_NOT_VALID)
        # priorities are not offered, which the standard has answered this way
        if event != EVENT_CYCLE or prescaler == 0 or priority != 0:
            raise Refused(Error.OUT_OF_RANGE)
        daq.timestamp, daq.prescaler = bool(mode & TIMESTAMP), prescaler

    def mode(self, number: int) -> tuple[int, int]:
        """Mode bits and prescaler of a list."""
        daq = self._list(number)
        return SELECTED * daq.selected | TIMESTAMP * daq.timestamp | RUNNING * daq.running, daq.prescaler

    def first_packet(self, number: int) -> int:
        """Packet identifier of a list's first packet: they are numbered through all lists."""
        self._list(number)
        return sum(len(each.odts) for each in self._lists[:number])

    def start_stop(self, mode: int, number: int) -> None:
        """Stop (0), start (1) or select (2) a list."""
        daq = self._list(number)
        if mode == 0:
            daq.running = daq.selected = False
        elif mode == 1:
            self._start([daq])
        elif mode == 2:
            daq.selected = True
        else:
            raise Refused(Error.MODE_NOT_VALID)

    def start_stop_all(self, mode: int) -> None:
        """Stop all (0), start the selected (1), stop the selected (2)."""
        if mode == 0:
            self.stop()
            return
        if mode not in (1, 2):
            raise Refused(Error.MODE_NOT_VALID)
        chosen = [each for each in self._lists if each.selected]
        if mode == 1:
            self._start(chosen)
        for each in chosen:
            each.running = mode == 1
            each.selected = False

    def stop(self) -> None:
        """Stop every list."""
        for each in self._lists:
            each.running = each.selected = False

    def _start(self, chosen: list[DaqList]) -> None:
        """Start lists together; none if one of them cannot be sent."""
        for daq in chosen:
            # the first packet may hold the timestamp alone: a float32 has no room beside it
            full = daq.odts[1:] if daq.timestamp else daq.odts
            if not daq.odts or not all(odt.entries for odt in full):
                raise Refused(Error.DAQ_CONFIG)
            if any(None in odt.entries for odt in daq.odts):
                raise Refused(Error.DAQ_CONFIG)
            if daq.timestamp and daq.odts[0].size + TIMESTAMP_BYTES > MAX_DTO - 1:
                raise Refused(Error.DAQ_CONFIG)
        for daq in chosen:
            daq.running, daq.cycles = True, 0

    def _list(self, number: int) -> DaqList:
        if number >= len(self._lists):
            raise Refused(Error.OUT_OF_RANGE)
        return self._lists[number]

    def _stopped(self, number: int) -> DaqList:
        daq = self._list(number)
        if daq.running:
            raise Refused(Error.DAQ_ACTIVE)
        return daq

    def sample(self, ticks: int) -> list[bytes]:
        """The packets of this cycle. ticks: its time [us], of which 32 bits are sent."""
        packets: list[bytes] = []
        first = 0
        for daq in self._lists:
            if daq.running:
                if daq.cycles == 0:
                    packets += self._packets(daq, first, ticks)
                daq.cycles = (daq.cycles + 1) % daq.prescaler
            first += len(daq.odts)
        return packets

    def _packets(self, daq: DaqList, first: int, ticks: int) -> list[bytes]:
        image = self._memory.image.bytes()
        packets = []
        for place, odt in enumerate(daq.odts):
            head = bytes([first + place])
            if daq.timestamp and place == 0:
                head += struct.pack("<I", ticks & 0xFFFF_FFFF)
            entries = (image[entry[0] : entry[0] + entry[1]] for entry in odt.entries if entry is not None)
            packets.append(head + b"".join(entries))
        return packets
