"""Client of the embedded hub: the Transport that `--bus hub:PATH` opens, and the query of the hub's counters."""

import errno
import os
import socket
import time
from collections import deque
from typing import Any

from bus import errors
from bus.closing import Closing
from bus.errors import FINDINGS_LIMIT, BusFinding
from bus.frame import ERROR, Frame
from bus.hub import packet
from bus.hub.listener import socket_name
from bus.hub.peer import enlarge_send_buffer
from bus.hub.status import HubStatus
from bus.transport import BusClosed, BusUnavailable, Statistics

ANSWER_S = 10.0
"""How long a hub may take to answer. A hub that waits for a processor is slow: 3.2 s, measured on two processors beside two busy processes."""


class HubTransport(Closing):
    """A Transport to the hub at `path`. Frames sent by others after construction are received."""

    def __init__(self, path: str, *, name: str = "", own_messages: bool = False) -> None:
        """name: shown in the hub's list of clients, by default the process id.

        own_messages: the hub returns our frames, stamped, for `confirmations`.
        BusUnavailable if no hub answers there.
        """
        self.path = path
        self._received = self._sent = self._dropped_in = self._dropped_out = self._errors = 0
        self._confirmed: list[Frame] = []
        self._findings: deque[BusFinding] = deque(maxlen=FINDINGS_LIMIT)
        self._partial = b""
        self._end = ""
        self._socket = _connect(path)
        hello = {"hello": name or f"pid {os.getpid()}", "protocol": packet.PROTOCOL, "own": own_messages}
        try:
            _ask(self._socket, path, hello, "welcome")
            enlarge_send_buffer(self._socket)
            self._socket.setblocking(False)
        except BaseException:
            self._socket.close()
            raise

    def send(self, frame: Frame) -> bool:
        """Hand one frame to the hub. False: the hub is too far behind, and the frame is lost."""
        try:
            taken = self._socket.send(packet.pack(frame))
        except BlockingIOError:
            self._dropped_out += 1
            return False
        except OSError as error:
            raise BusClosed(f"{self.path}: the hub is gone; frames can no longer be sent") from error
        # a partial record would shift every following one; the stream could not be read again
        if taken < packet.SIZE:  # Linux takes less than a page whole, or not at all
            raise BusClosed(f"{self.path}: the socket took {taken} bytes of a frame's {packet.SIZE}")
        self._sent += 1
        return True

    def drain(self, limit: int = 64) -> list[Frame]:
        """At most `limit` frames that have arrived, stamped by the hub; [] if there are none."""
        frames: list[Frame] = []
        records, make = self._receive(limit), Frame._make
        for can_id, length, flags, kind, data, at_ns, dropped in packet.LAYOUT.iter_unpack(records):
            frame = make((can_id, data[:length], at_ns, flags))
            # the hub's running total, not an increment; 0 means "not reported in this record"
            if dropped:
                self._dropped_in = dropped
            # kind is 0 for frames of others: one test keeps the common path short
            if kind:
                if kind == packet.CONTROL:
                    self._note_refusal(records)
                    break
                self._confirmed.append(frame)
                continue
            frames.append(frame)
            if can_id & ERROR:
                self._errors += 1
                self._findings += errors.findings(frame)
        self._received += len(frames)
        return frames

    def _receive(self, limit: int) -> bytes:
        """At most `limit` whole records that have arrived; BusClosed if none will ever come."""
        if self._end:
            raise BusClosed(self._end)
        try:
            records = self._socket.recv(limit * packet.SIZE - len(self._partial))
        except BlockingIOError:
            return b""
        except ConnectionResetError:  # the hub closed with records of ours unread
            records = b""
        except OSError as error:
            raise BusClosed(f"{self.path}: {error.strerror}; was the transport closed?") from error
        if not records:
            self._end = f"{self.path}: the hub is gone"
            raise BusClosed(self._end)
        # nearly always whole records: returned without a copy
        if not self._partial and len(records) % packet.SIZE == 0:
            return records
        records = self._partial + records
        # a stream socket may cut anywhere: the beginning of a record waits for its end
        whole = len(records) // packet.SIZE * packet.SIZE
        self._partial = records[whole:]
        return records[:whole]

    def _note_refusal(self, records: bytes) -> None:
        """Keep the hub's reason for ending the connection; frames received before it remain valid."""
        # `drain` met a control record, so one exists
        at = next(at for at in range(0, len(records), packet.SIZE) if packet.control_size(records, at))
        message = records[at:] + self._partial
        try:
            message += self._socket.recv(max(packet.control_size(message) - len(message), 0))
            reason = packet.read_control(message).get("refused", "unexpected control message")
        except (OSError, ValueError) as error:
            reason = f"for a reason that was lost ({error})"
        self._end = f"{self.path}: the hub ended the connection: {reason}"

    def confirmations(self) -> list[Frame]:
        """Own frames that the bus has carried, with its stamps, as far as `drain` has read."""
        confirmed, self._confirmed = self._confirmed, []
        return confirmed

    def findings(self) -> list[BusFinding]:
        """Findings from error frames since the last call."""
        found = list(self._findings)
        self._findings.clear()
        return found

    def fileno(self) -> int:
        """Readable when `drain` has something to give, or the hub is gone."""
        return self._socket.fileno()

    def statistics(self) -> Statistics:
        """Counters since opening."""
        return Statistics(
            received=self._received,
            sent=self._sent,
            dropped_in=self._dropped_in,
            dropped_out=self._dropped_out,
            errors=self._errors,
        )

    def close(self) -> None:
        """Leave the hub; a second call does nothing."""
        self._socket.close()


def hub_status(path: str) -> HubStatus:
    """Ask the hub at `path` for its counters; BusUnavailable if none answers."""
    with _connect(path) as connection:
        message = _ask(connection, path, {"status": True}, "status")
    try:
        return HubStatus.from_message(message)
    except (TypeError, KeyError, ValueError) as error:
        raise BusUnavailable(f"{path}: what listens there does not behave like a hub: {error}") from error


def wait_for_hub(path: str, timeout_s: float = 5.0) -> None:
    """Return once a hub answers at `path`; BusUnavailable if none does in time."""
    deadline = time.monotonic() + timeout_s
    while True:
        try:
            hub_status(path)
        except BusUnavailable:
            if time.monotonic() > deadline:
                raise
            # polled: the kernel reports no event when somebody starts to listen at an address
            time.sleep(0.01)
        else:
            return


def _connect(path: str) -> socket.socket:
    name = socket_name(path)
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    connection.settimeout(ANSWER_S)
    try:
        connection.connect(name)
    except OSError as error:
        connection.close()
        raise BusUnavailable(f"{path}: {_why_not(error, path)}") from error
    return connection


def _why_not(error: OSError, path: str) -> str:
    start = f"loaderhil hub --bus hub:{path}"
    match error:
        case FileNotFoundError():
            return f"there is no hub; start one there first ({start})"
        case ConnectionRefusedError():
            return f"no hub listens there (it ended, or was killed); start one ({start})"
        case PermissionError():
            return "no permission; the hub belongs to another user, who would have to share it (chmod)"
        # a socket of another type than SOCK_STREAM listens there
        case OSError(errno=errno.EPROTOTYPE):
            return "what listens there is no hub, or one of an older loaderhil"
        case _:
            return f"cannot be reached: {error.strerror or error}"


def _ask(connection: socket.socket, path: str, question: dict[str, Any], answer: str) -> dict[str, Any]:
    """Send a control message and return its answer. BusUnavailable if none comes, or another one."""
    try:
        connection.send(packet.control(question))
        head = _receive_exactly(connection, packet.SIZE)
        size = packet.control_size(head)
        if not packet.SIZE <= size <= packet.CONTROL_LIMIT:
            raise ValueError("no control message")
        message = packet.read_control(head + _receive_exactly(connection, size - packet.SIZE))
    except TimeoutError as error:
        raise BusUnavailable(
            f"{path}: the hub does not answer within {ANSWER_S:g} s; is it stopped?"
        ) from error
    except (OSError, ValueError) as error:
        raise BusUnavailable(f"{path}: what listens there does not behave like a hub: {error}") from error
    if answer not in message:
        raise BusUnavailable(f"{path}: the hub refused: {message.get('refused', message)}")
    return message


def _receive_exactly(connection: socket.socket, size: int) -> bytes:
    """Exactly `size` bytes; the bytes that follow stay in the socket."""
    data = b""
    while len(data) < size:
        chunk = connection.recv(size - len(data))
        if not chunk:
            raise ConnectionResetError("it hung up")
        data += chunk
    return data
