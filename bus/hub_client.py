"""A client of the embedded hub."""

import os
import socket
import time
from collections import deque
from types import TracebackType
from typing import Any, Self

from bus import errors, packet
from bus.errors import FINDINGS_LIMIT, BusFinding
from bus.frame import ERROR, Frame
from bus.hub_peer import enlarge_send_buffer
from bus.hub_status import HubStatus
from bus.listener import socket_name
from bus.transport import BusClosed, BusUnavailable, Statistics

ANSWER_S = 2.0
"""How long a hub may take to answer."""
_RECEIVE = 256
"""More than a frame: anything that fills it is not one."""


class HubTransport:
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
        self._ended = False
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
            self._socket.send(packet.pack(frame))
        except BlockingIOError:
            self._dropped_out += 1
            return False
        except OSError as error:
            raise BusClosed(f"{self.path}: the hub is gone; frames can no longer be sent") from error
        self._sent += 1
        return True

    def drain(self, limit: int = 64) -> list[Frame]:
        """At most `limit` frames that have arrived, stamped by the hub; [] if there are none."""
        frames: list[Frame] = []
        receive, unpack = self._socket.recv, packet.LAYOUT.unpack
        dropped = self._dropped_in
        try:
            for _ in range(0 if self._ended else limit):
                data = receive(_RECEIVE)
                if len(data) != packet.SIZE:
                    self._note_end(data)
                    break
                can_id, length, flags, own, content, at_ns, dropped = unpack(data)
                frame = Frame(can_id, content[:length], at_ns, flags)
                if own:
                    self._confirmed.append(frame)
                    continue
                frames.append(frame)
                if can_id & ERROR:
                    self._errors += 1
                    self._findings += errors.findings(frame)
        except BlockingIOError:
            pass
        except ConnectionResetError:  # the hub closed with packets of ours unread; its own come first
            pass
        except OSError as error:
            raise BusClosed(f"{self.path}: {error.strerror}; was the transport closed?") from error
        self._dropped_in = dropped
        self._received += len(frames)
        if self._ended and not frames:
            raise BusClosed(f"{self.path}: the hub is gone")
        return frames

    def _note_end(self, data: bytes) -> None:
        if data:
            reason = packet.read_control(data).get("refused", "spoke out of turn")
            raise BusClosed(f"{self.path}: the hub ended the connection: {reason}")
        self._ended = True

    def confirmations(self) -> list[Frame]:
        """Own frames that the bus has carried, with its stamps, as far as `drain` has met them."""
        confirmed, self._confirmed = self._confirmed, []
        return confirmed

    def findings(self) -> list[BusFinding]:
        """What error frames have told since the last call."""
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

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


def hub_status(path: str) -> HubStatus:
    """Ask the hub at `path` for its counters; BusUnavailable if none answers."""
    with _connect(path) as connection:
        return HubStatus.from_message(_ask(connection, path, {"status": True}, "status"))


def wait_for_hub(path: str, timeout_s: float = 5.0) -> None:
    """Return once a hub answers at `path`; BusUnavailable if none does in time."""
    deadline = time.monotonic() + timeout_s
    while True:
        try:
            hub_status(path)
        except BusUnavailable:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.01)
        else:
            return


def _connect(path: str) -> socket.socket:
    name = socket_name(path)
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    connection.settimeout(ANSWER_S)
    try:
        connection.connect(name)
    except OSError as error:
        connection.close()
        raise BusUnavailable(f"{path}: {_why_not(error)}") from error
    return connection


def _why_not(error: OSError) -> str:
    match error:
        case FileNotFoundError():
            return "there is no hub; start one there first (loaderhil hub)"
        case ConnectionRefusedError():
            return "no hub listens there (it ended, or was killed); start one (loaderhil hub)"
        case PermissionError():
            return "no permission; the hub belongs to another user"
        case _:
            return f"cannot be reached: {error.strerror or error}"


def _ask(connection: socket.socket, path: str, question: dict[str, Any], answer: str) -> dict[str, Any]:
    """Put a control message and wait for its answer."""
    try:
        connection.send(packet.control(question))
        message = packet.read_control(connection.recv(packet.CONTROL_LIMIT))
    except TimeoutError as error:
        raise BusUnavailable(
            f"{path}: the hub does not answer within {ANSWER_S:g} s; is it stopped?"
        ) from error
    except (OSError, ValueError) as error:
        raise BusUnavailable(f"{path}: what listens there does not behave like a hub: {error}") from error
    if answer not in message:
        raise BusUnavailable(f"{path}: the hub refused: {message.get('refused', message)}")
    return message
