"""One client as the hub holds it: its socket, its counters, and the data that either side has not taken yet."""

import contextlib
import socket
import struct
from collections import deque
from itertools import islice

from bus.hub import packet
from bus.hub.status import ClientStatus

SOCKET_BUFFER = 4 << 20
"""Send buffer asked for [bytes]; the kernel grants at most net.core.wmem_max without privilege."""
SO_SNDBUFFORCE = 32  # include/uapi/asm-generic/socket.h
BACKLOG_LIMIT = 16384
"""Frames held for a client whose socket is full: four seconds of a 500 kbit/s bus."""
FLUSH = 64
"""Frames of the backlog that are sent at once."""
_DROPPED = packet.DROPPED


class Peer:
    """A connection; a client once it has said hello. Nothing here blocks."""

    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        enlarge_send_buffer(connection)
        self.connection = connection
        self.number = connection.fileno()
        self.name = ""  # empty until it has said hello
        self.wants_own = False  # whether its own frames return to it as confirmations
        self.gone = False  # to be removed at the end of the current round
        self._deaf = False  # it has left, but the hub may not have read everything that it sent
        self.unread = b""  # beginning of a record, or of a control message, whose end has not arrived
        self.pid = peer_pid(connection)
        self.sent = self.delivered = self.dropped = self.malformed = 0
        self._backlog: deque[bytes] = deque()
        # bound once: called for every batch
        self.receive = connection.recv_into
        self._send = connection.send

    @property
    def behind(self) -> bool:
        """Whether frames wait until its socket is writable."""
        return bool(self._backlog)

    def give(self, records: memoryview, count: int) -> bool:
        """Pass on `count` frames; False if the hub now has to wait for the socket."""
        if self._deaf:
            return True
        if self._backlog:
            # order matters more than speed: nothing may overtake the frames that already wait
            self._hold(records)
            return True
        if self.dropped:
            records = self._with_drops(bytearray(records))
        try:
            taken = self._send(records)
        except BlockingIOError:
            taken = 0
        except ConnectionError:
            self._hang_up()
            return True
        except OSError:  # no memory: its stream would have a gap that nobody counts
            self.gone = True
            return True
        if taken == len(records):
            self.delivered += count
            return True
        self._hold(records)
        self._forget(taken)
        return False

    def _with_drops(self, records: bytearray) -> memoryview:
        """The records, the last of them with the count of frames lost."""
        # the count wraps at 32 bits, as the kernel's does
        _DROPPED.pack_into(records, len(records) - _DROPPED.size, self.dropped & 0xFFFF_FFFF)
        return memoryview(records)

    def _hold(self, records: memoryview) -> None:
        """Keep frames for later; those beyond the limit are lost for this client, and counted."""
        for at in range(0, len(records), packet.SIZE):
            if len(self._backlog) < BACKLOG_LIMIT:
                self._backlog.append(bytes(records[at : at + packet.SIZE]))
            else:
                self.dropped += 1

    def _forget(self, taken: int) -> None:
        """The socket has taken so many bytes of the backlog."""
        while taken:
            first = self._backlog.popleft()
            if taken < len(first):
                self._backlog.appendleft(first[taken:])
                return
            taken -= len(first)
            self.delivered += 1

    def flush(self) -> None:
        """Give what waits, as far as the socket takes it."""
        try:
            while self._backlog:
                # a copy, because the drop count is written into it; only taken bytes leave the backlog
                records = bytearray().join(islice(self._backlog, FLUSH))
                self._forget(self._send(self._with_drops(records)))
        except BlockingIOError:
            return
        except ConnectionError:
            self._hang_up()
        except OSError:
            self.gone = True

    def _hang_up(self) -> None:
        """It has left. It stays in the list of clients until everything that it sent before has been read."""
        self._deaf = True
        self._backlog.clear()

    def say(self, message: bytes) -> None:
        """Send a control message; it is lost if the client does not read."""
        if not self._backlog:
            with contextlib.suppress(OSError):
                # half a control message would break the stream for good, so the client is removed instead
                self.gone |= self._send(message) < len(message)

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
        # the forced form ignores net.core.wmem_max, but needs CAP_NET_ADMIN
        connection.setsockopt(socket.SOL_SOCKET, SO_SNDBUFFORCE, SOCKET_BUFFER)
    except PermissionError:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SOCKET_BUFFER)


def peer_pid(connection: socket.socket) -> int:
    """The process at the other end (0 if it lives in another namespace)."""
    credentials = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12)
    return int(struct.unpack("=iII", credentials)[0])
