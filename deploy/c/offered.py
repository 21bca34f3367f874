"""XCP and UDS of an ECU in C, as a service of the ECU's process."""

import ctypes
import struct
from collections.abc import Callable
from typing import Final

from bus.frame import FD, Frame
from ecu.measure.channel import Channel

_FRAME: Final = struct.Struct("=IB8s3x")
"""EcuFrame of ecu.h, with the bytes that fill it up to its alignment."""
_RANDOM: Final = ctypes.CFUNCTYPE(ctypes.c_bool, ctypes.POINTER(ctypes.c_uint8), ctypes.c_uint8)


class OfferedInC:
    """What a loaded library with services offers. As `ecu.node.BusService`."""

    def __init__(
        self,
        c: ctypes.CDLL,
        channels: tuple[Channel | None, Channel | None],
        secret: bytes | None,
        random: Callable[[int], bytes],
    ) -> None:
        """channels: of XCP and of UDS; secret: without one nothing can be unlocked; random: so many bytes that nobody can foresee."""
        self._c = c
        self._received = {channel.receive for channel in channels if channel is not None}
        most = ctypes.c_uint32.in_dll(c, "library_most_sent").value
        self._frames = (ctypes.c_char * (most * _FRAME.size)).in_dll(c, "library_sent")
        self._count = ctypes.c_uint32.in_dll(c, "library_sent_count")

        def drawn(place: "ctypes._Pointer[ctypes.c_uint8]", count: int) -> bool:
            ctypes.memmove(place, random(count), count)
            return True

        self._drawn = _RANDOM(drawn)  # kept: C calls it as long as the library is loaded
        ctypes.c_void_p.in_dll(c, "library_random").value = ctypes.cast(self._drawn, ctypes.c_void_p).value
        words: list[ctypes.c_bool | ctypes.c_uint32] = []
        for channel in channels:
            receive, send = (channel.receive, channel.send) if channel is not None else (0, 0)
            words += [ctypes.c_bool(channel is not None), ctypes.c_uint32(receive), ctypes.c_uint32(send)]
        key = secret or b""
        c.library_services_start(*words, key, ctypes.c_uint16(len(key)))

    def receive(self, frame: Frame, now_ns: int) -> list[Frame]:
        """The answers to a frame of a tool."""
        if frame.can_id not in self._received or frame.flags & FD:
            return []
        data = frame.data
        self._c.services_receive(
            ctypes.c_uint32(frame.can_id), data, ctypes.c_uint8(len(data)), ctypes.c_int64(now_ns)
        )
        return self._sent()

    def before_cycle(self, now_ns: int) -> None:
        """What a tool has written acts from this cycle on."""
        self._c.services_before_cycle(ctypes.c_int64(now_ns))

    def after_cycle(self, now_ns: int) -> list[Frame]:
        """Lists of measurements, and the next frames of a long answer."""
        self._c.services_after_cycle(ctypes.c_int64(now_ns))
        return self._sent()

    def may_send(self) -> bool:
        """It keeps nobody from sending."""
        return True

    def _sent(self) -> list[Frame]:
        count, self._count.value = self._count.value, 0
        raw = memoryview(self._frames)[: count * _FRAME.size]
        return [Frame(can_id, data[:length]) for can_id, length, data in _FRAME.iter_unpack(raw)]
