"""The XCP slave: command packets in, answer packets out. No bus and no clock here.

Every malformed command is answered by the standard's error code. Nothing a tool sends raises.
"""

import struct
from collections.abc import Callable
from typing import Final

from ecu.measure.access import Lock
from ecu.measure.pages import REFERENCE, WORKING
from ecu.xcp.daq import DaqLists
from ecu.xcp.memory import Memory
from ecu.xcp.packets import (
    ERROR,
    EV_SESSION_TERMINATED,
    EVENT,
    LEAST_LENGTH,
    MAX_CTO,
    MAX_DTO,
    RESPONSE,
    Command,
    Error,
    Refused,
    Resource,
)

Handler = Callable[[bytes], "bytes | list[bytes]"]
SILENCE_NS: Final = 60_000_000_000
"""A tool with write access that is silent for this long has lost it: it may be gone, with its values still at work."""
SEGMENT: Final = 0
SLAVE_BLOCK_MODE, OPTIONAL_INFO = 0x40, 0x80
DYNAMIC_LISTS, PRESCALER, TIMESTAMPS = 0x01, 0x02, 0x10
DAQ_OF_EVENT, ALL_OF_ONE_EVENT = 0x04, 0x80
MICROSECOND, FOUR_BYTES = 3 << 4, 4
MILLISECOND: Final = 6
ECU_PAGE, XCP_PAGE, ALL_SEGMENTS = 0x01, 0x02, 0x80
CRC_32: Final = 0x09
EVENT_NAME: Final = b"cycle"
PAGE_ACCESS: Final = {REFERENCE: 0x0F, WORKING: 0x3F}
"""GET_PAGE_INFO: the ECU and the tool read both pages at any time; the tool writes the working page only."""


class XcpSlave:
    """One ECU as a measuring and calibrating tool sees it."""

    def __init__(self, memory: Memory, lock: Lock, identifications: dict[int, bytes]) -> None:
        """identifications: answers to GET_ID by type, such as 1: name of the A2L file without extension."""
        self._memory, self._pages, self._lock = memory, memory.pages, lock
        self._identifications = identifications
        self.daq = DaqLists(memory)
        self.connected = False
        self._heard_ns = 0
        self._mta = (0, 0)  # address, extension
        self._text: bytes | None = None  # what UPLOAD reads instead of the memory
        self._seed, self._key = b"", b""  # what is still to be sent, and what has come
        self._key_length = 0
        self._commands: dict[int, Handler] = {
            command: getattr(self, f"_{command.name.lower()}") for command in Command
        }

    def command(self, packet: bytes, now_ns: int) -> list[bytes]:
        """The answers to one command packet; none while no tool is connected, unless it connects."""
        if not packet or (not self.connected and packet[0] != Command.CONNECT):
            return []
        self._heard_ns = now_ns
        handler = self._commands.get(packet[0])
        try:
            if handler is None:
                raise Refused(Error.CMD_UNKNOWN)
            if len(packet) < LEAST_LENGTH.get(Command(packet[0]), 1):
                raise Refused(Error.CMD_SYNTAX)
            answer = handler(packet)
        except Refused as refused:
            return [bytes((ERROR, refused.code))]
        return answer if isinstance(answer, list) else [bytes((RESPONSE,)) + answer]

    def before_cycle(self, now_ns: int) -> list[bytes]:
        """A cycle begins: written values are taken over. An event packet where the tool has been silent too long."""
        events = []
        if self._lock.open and now_ns - self._heard_ns > SILENCE_NS:
            self.end()
            events.append(bytes((EVENT, EV_SESSION_TERMINATED)))
        self._pages.before_cycle()
        return events

    def after_cycle(self, now_ns: int) -> list[bytes]:
        """The measured packets of the cycle."""
        return self.daq.sample(now_ns // 1000) if self.connected else []

    def end(self) -> None:
        """End the session: nothing is sent, calibration is locked, and the ECU works with its file's values again."""
        self.connected = False
        self._lock.close()
        self.daq.reset()
        self._pages.reset()
        self._pages.active = self._memory.page = WORKING
        self._seed, self._key, self._key_length = b"", b"", 0
        self._text, self._mta = None, (0, 0)

    # --- session ---

    def _connect(self, packet: bytes) -> bytes:
        if packet[1] != 0:
            raise Refused(Error.OUT_OF_RANGE)  # the mode in which some ECUs are flashed
        if not self.connected:
            self.end()
            self.connected = True
        offered = Resource.CALIBRATION | Resource.DAQ
        return struct.pack("<BBBHBB", offered, SLAVE_BLOCK_MODE | OPTIONAL_INFO, MAX_CTO, MAX_DTO, 1, 1)

    def _disconnect(self, packet: bytes) -> bytes:
        self.end()
        return b""

    def _protected(self) -> int:
        return 0 if self._lock.open else int(Resource.CALIBRATION)

    def _get_status(self, packet: bytes) -> bytes:
        return struct.pack("<BBBH", 0x40 * self.daq.running, self._protected(), 0, 0)

    def _synch(self, packet: bytes) -> bytes:
        raise Refused(Error.CMD_SYNCH)  # this answer is what the standard asks for

    def _get_comm_mode_info(self, packet: bytes) -> bytes:
        return struct.pack("<BBBBBBB", 0, 0, 0, 0, 0, 0, 0x10)

    def _get_id(self, packet: bytes) -> bytes:
        text = self._identifications.get(packet[1], b"")
        self._text = text
        return struct.pack("<BHI", 0, 0, len(text))

    # --- access ---

    def _get_seed(self, packet: bytes) -> bytes:
        mode, resource = packet[1], packet[2]
        if mode == 0:
            if resource not in (Resource.CALIBRATION, Resource.DAQ):
                raise Refused(Error.OUT_OF_RANGE)
            unlocked = resource == Resource.DAQ or self._lock.open
            self._seed = b"" if unlocked else self._lock.seed()
            self._key, self._key_length = b"", 0
        elif mode != 1 or not self._seed:
            raise Refused(Error.SEQUENCE if mode == 1 else Error.OUT_OF_RANGE)
        left, part = len(self._seed), self._seed[: MAX_CTO - 2]
        self._seed = self._seed[len(part) :]
        return bytes((left,)) + part

    def _unlock(self, packet: bytes) -> bytes:
        left, part = packet[1], packet[2:]
        if self._key_length == 0:
            self._key_length = left
        if left == 0 or left != self._key_length - len(self._key):
            self._key, self._key_length = b"", 0
            raise Refused(Error.SEQUENCE)
        self._key += part[:left]
        if len(self._key) < self._key_length:
            return bytes((self._protected(),))
        key, self._key, self._key_length = self._key, b"", 0
        if not self._lock.unlock(key):
            self.end()  # as the standard asks for after a wrong key
            raise Refused(Error.ACCESS_LOCKED)
        return bytes((self._protected(),))

    def _need_access(self) -> None:
        if not self._lock.open:
            raise Refused(Error.ACCESS_LOCKED)

    # --- memory ---

    def _set_mta(self, packet: bytes) -> bytes:
        extension, address = struct.unpack_from("<BI", packet, 3)
        self._mta, self._text = (address, extension), None
        return b""

    def _upload(self, packet: bytes) -> list[bytes]:
        count = packet[1]
        if count == 0:
            raise Refused(Error.OUT_OF_RANGE)
        if self._text is not None:
            data, self._text = self._text[:count], self._text[count:]
            if len(data) < count:
                raise Refused(Error.ACCESS_DENIED)
        else:
            address, extension = self._mta
            data = self._memory.read(address, extension, count)
            self._mta = (address + count, extension)
        # more than one packet holds: slave block mode
        step = MAX_CTO - 1
        return [bytes((RESPONSE,)) + data[at : at + step] for at in range(0, count, step)]

    def _short_upload(self, packet: bytes) -> bytes:
        count, _, extension, address = struct.unpack_from("<BBBI", packet, 1)
        if not 1 <= count <= MAX_CTO - 1:
            raise Refused(Error.OUT_OF_RANGE)
        data = self._memory.read(address, extension, count)
        self._mta, self._text = (address + count, extension), None
        return data

    def _build_checksum(self, packet: bytes) -> bytes:
        size = struct.unpack_from("<I", packet, 4)[0]
        address, extension = self._mta
        if size == 0 or self._text is not None:
            raise Refused(Error.OUT_OF_RANGE)
        checksum = self._memory.checksum(address, extension, size)
        self._mta = (address + size, extension)
        return struct.pack("<BHI", CRC_32, 0, checksum)

    def _download(self, packet: bytes) -> bytes:
        self._need_access()
        count, data = packet[1], packet[2:]
        if not 1 <= count <= MAX_CTO - 2:
            raise Refused(Error.OUT_OF_RANGE)
        if len(data) < count:
            raise Refused(Error.CMD_SYNTAX)
        if self._text is not None:
            raise Refused(Error.ACCESS_DENIED)
        address, extension = self._mta
        self._memory.write(address, extension, data[:count])
        self._mta = (address + count, extension)
        return b""

    # --- pages ---

    def _set_cal_page(self, packet: bytes) -> bytes:
        mode, segment, page = packet[1:4]
        if page not in (REFERENCE, WORKING):
            raise Refused(Error.PAGE_NOT_VALID)
        if segment != SEGMENT and not mode & ALL_SEGMENTS:
            raise Refused(Error.SEGMENT_NOT_VALID)
        if not mode & (ECU_PAGE | XCP_PAGE):
            raise Refused(Error.MODE_NOT_VALID)
        if mode & ECU_PAGE:
            self._need_access()
            self._pages.active = page
        if mode & XCP_PAGE:  # only what the tool itself reads
            self._memory.page = page
        return b""

    def _get_cal_page(self, packet: bytes) -> bytes:
        mode, segment = packet[1:3]
        if segment != SEGMENT:
            raise Refused(Error.SEGMENT_NOT_VALID)
        if mode not in (ECU_PAGE, XCP_PAGE):
            raise Refused(Error.MODE_NOT_VALID)
        return bytes((0, 0, self._pages.active if mode == ECU_PAGE else self._memory.page))

    def _copy_cal_page(self, packet: bytes) -> bytes:
        self._need_access()
        source_segment, source, segment, page = packet[1:5]
        if source_segment != SEGMENT or segment != SEGMENT:
            raise Refused(Error.SEGMENT_NOT_VALID)
        if source not in (REFERENCE, WORKING) or page not in (REFERENCE, WORKING):
            raise Refused(Error.PAGE_NOT_VALID)
        if page == REFERENCE:
            raise Refused(Error.WRITE_PROTECTED)
        if source == REFERENCE:
            self._pages.reset()
        return b""

    def _get_pag_processor_info(self, packet: bytes) -> bytes:
        return bytes((1, 0))

    def _get_segment_info(self, packet: bytes) -> bytes:
        mode, segment, kind = packet[1:4]
        if segment != SEGMENT:
            raise Refused(Error.SEGMENT_NOT_VALID)
        if mode == 0 and kind in (0, 1):
            base, size = self._memory.calibration_area
            return struct.pack("<BHI", 0, 0, (base, size)[kind])
        if mode == 1:
            return struct.pack("<BBBBB", len(PAGE_ACCESS), 0, 0, 0, 0)
        raise Refused(Error.OUT_OF_RANGE)

    def _get_page_info(self, packet: bytes) -> bytes:
        segment, page = packet[2:4]
        if segment != SEGMENT:
            raise Refused(Error.SEGMENT_NOT_VALID)
        if page not in PAGE_ACCESS:
            raise Refused(Error.PAGE_NOT_VALID)
        return bytes((PAGE_ACCESS[page], 0))

    # --- lists of measurements ---

    def _get_daq_processor_info(self, packet: bytes) -> bytes:
        properties = DYNAMIC_LISTS | PRESCALER | TIMESTAMPS
        return struct.pack("<BHHBB", properties, self.daq.count, 1, 0, 0)

    def _get_daq_resolution_info(self, packet: bytes) -> bytes:
        return struct.pack("<BBBBBH", 1, MAX_DTO - 1, 1, 0, MICROSECOND | FOUR_BYTES, 1)

    def _get_daq_event_info(self, packet: bytes) -> bytes:
        if struct.unpack_from("<H", packet, 2)[0] != 0:
            raise Refused(Error.OUT_OF_RANGE)
        self._text = EVENT_NAME
        return struct.pack(
            "<BBBBBB", DAQ_OF_EVENT | ALL_OF_ONE_EVENT, 0xFF, len(EVENT_NAME), 10, MILLISECOND, 0
        )

    def _get_daq_clock(self, packet: bytes) -> bytes:
        return struct.pack("<BHI", 0, 0, self._heard_ns // 1000 & 0xFFFF_FFFF)

    def _idle(self) -> None:
        if self.daq.running:
            raise Refused(Error.DAQ_ACTIVE)

    def _free_daq(self, packet: bytes) -> bytes:
        self.daq.free()
        return b""

    def _alloc_daq(self, packet: bytes) -> bytes:
        self._idle()
        self.daq.allocate(struct.unpack_from("<H", packet, 2)[0])
        return b""

    def _alloc_odt(self, packet: bytes) -> bytes:
        self._idle()
        self.daq.allocate_odts(*struct.unpack_from("<HB", packet, 2))
        return b""

    def _alloc_odt_entry(self, packet: bytes) -> bytes:
        self._idle()
        self.daq.allocate_entries(*struct.unpack_from("<HBB", packet, 2))
        return b""

    def _clear_daq_list(self, packet: bytes) -> bytes:
        self.daq.clear(struct.unpack_from("<H", packet, 2)[0])
        return b""

    def _set_daq_ptr(self, packet: bytes) -> bytes:
        self.daq.point_to(*struct.unpack_from("<HBB", packet, 2))
        return b""

    def _write_daq(self, packet: bytes) -> bytes:
        self.daq.write(*struct.unpack_from("<BBBI", packet, 1))
        return b""

    def _set_daq_list_mode(self, packet: bytes) -> bytes:
        self.daq.set_mode(*struct.unpack_from("<BHHBB", packet, 1))
        return b""

    def _get_daq_list_mode(self, packet: bytes) -> bytes:
        mode, prescaler = self.daq.mode(struct.unpack_from("<H", packet, 2)[0])
        return struct.pack("<BHHBB", mode, 0, 0, prescaler, 0)

    def _start_stop_daq_list(self, packet: bytes) -> bytes:
        mode, number = struct.unpack_from("<BH", packet, 1)
        self.daq.start_stop(mode, number)
        return bytes((self.daq.first_packet(number),))

    def _start_stop_synch(self, packet: bytes) -> bytes:
        self.daq.start_stop_all(packet[1])
        return b""
