"""One client as the hub holds it: its socket, its counters, and the frames it has not taken yet."""

import contextlib
import socket
import struct
from collections import deque

from bus import packet
from bus.hub_status import ClientStatus

SOCKET_BUFFER = 4 << 20
"""Send buffer asked for [bytes]; the kernel grants at most net.core.wmem_max without privilege."""
SO_SNDBUFFORCE = 32  # include/uapi/asm-generic/socket.h
BACKLOG_LIMIT = 16384
"""Frames held for a client whose socket is full: four seconds of a 500 kbit/s bus."""
_DROPPED = struct.Struct("=I")
_DROPPED_AT = packet.SIZE - _DROPPED.size


class Peer:
    """A connection; a client once it has said hello. Nothing here blocks."""

    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        enlarge_send_buffer(connection)
        self.connection = connection
        self.number = connection.fileno()
        self.name = ""
        self.wants_own = False
        self.gone = False
        self.pid = peer_pid(connection)
        self.sent = self.delivered = self.dropped = self.malformed = 0
        self._backlog: deque[bytes] = deque()
        self._send = connection.send

    @property
    def behind(self) -> bool:
        """Whether frames wait until its socket is writable."""
        return bool(self._backlog)

    def give(self, frame: memoryview) -> bool:
        """Pass on a frame's packet; False if the hub now has to wait for the socket."""
        if self._backlog:
            self._hold(frame)
            return True
        if self.dropped:
            _DROPPED.pack_into(frame, _DROPPED_AT, self.dropped & 0xFFFF_FFFF)
        try:
            self._send(frame)
            self.delivered += 1
        except BlockingIOError:
            self._hold(frame)
            return False
        except OSError:
            self.gone = True
        finally:
            if self.dropped:
                _DROPPED.pack_into(frame, _DROPPED_AT, 0)
        return True

    def _hold(self, frame: memoryview) -> None:
        if len(self._backlog) < BACKLOG_LIMIT:
            self._backlog.append(bytes(frame))
        else:
            self.dropped += 1

    def flush(self) -> None:
        """Give what waits, as far as the socket takes it."""
        try:
            while self._backlog:
                frame = bytearray(self._backlog[0])
                _DROPPED.pack_into(frame, _DROPPED_AT, self.dropped & 0xFFFF_FFFF)
                self._send(frame)
                self._backlog.popleft()
                self.delivered += 1
        except BlockingIOError:
            return
        except OSError:
            self.gone = True

    def say(self, message: bytes) -> None:
        """Send a control message; lost if the client is not reading."""
        with contextlib.suppress(OSError):
            self._send(message)

    def status(self, waiting: int) -> ClientStatus:
        """Its counters; waiting: its frames that the modelled wire has not carried."""
        return ClientStatus(
            name=self.name,
            pid=self.pid,
            sent=self.sent,
            delivered=self.delivered,
            dropped=self.dropped,
            backlog=len(self._backlog),
            waiting=waiting,
            malformed=self.malformed,
        )


def enlarge_send_buffer(connection: socket.socket) -> None:
    """Ask for room for several thousand frames; less is granted silently."""
    try:
        connection.setsockopt(socket.SOL_SOCKET, SO_SNDBUFFORCE, SOCKET_BUFFER)
    except PermissionError:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SOCKET_BUFFER)


def peer_pid(connection: socket.socket) -> int:
    """The process at the other end (0 if it lives in another namespace)."""
    credentials = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12)
    return int(struct.unpack("=iII", credentials)[0])
