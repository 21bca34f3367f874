"""The control socket of a gateway, for live fault injection: JSON over a Unix socket, one packet each way.

The server is for a loop that waits on descriptors, as the gateway's does; it never blocks. Requests and
answers are those of `Injector.command`.
"""

import contextlib
import errno
import json
import os
import select
import socket
import stat
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from bus.bounded_json import read_object
from bus.closing import Closing
from bus.user_error import UserError

REQUEST_LIMIT = 8_192
"""Longest command [bytes]; the longest fault table takes some 500."""
ANSWER_LIMIT = 65_536
"""Longest answer [bytes]: the list of some 500 faults."""
PATH_LIMIT = 107
"""Bytes in a socket's name (struct sockaddr_un)."""
CLIENTS_LIMIT = 16
ANSWER_S = 5.0


class ControlUnavailable(UserError, ConnectionError):
    """No control socket can be made or reached there; the message says which and why."""


class Refused(UserError, ValueError):
    """The injector refused a command; the message is its reason."""


class ControlServer(Closing):
    """Answers commands. Wait on `fileno`, then call `serve`."""

    def __init__(self, path: Path, obey: Callable[[Mapping[str, Any]], Mapping[str, Any]]) -> None:
        """path: where the socket is made; one left there by a killed process is replaced."""
        self._obey = obey
        self._path = path
        self._clients: dict[int, socket.socket] = {}
        self._listener = _listen(path)
        # an epoll of its own, so that the gateway waits on one descriptor, whatever the number of clients
        self._epoll = select.epoll()
        self._epoll.register(self._listener, select.EPOLLIN)

    def fileno(self) -> int:
        """Readable when there is something to do."""
        return self._epoll.fileno()

    def serve(self) -> None:
        """Answer what has been asked."""
        for descriptor, _ in self._epoll.poll(0):
            if descriptor == self._listener.fileno():
                self._accept()
            else:
                self._answer(descriptor)

    def _accept(self) -> None:
        with contextlib.suppress(BlockingIOError):
            client, _ = self._listener.accept()
            # refused, not queued: descriptors of the gateway's process are limited
            if len(self._clients) >= CLIENTS_LIMIT:
                client.close()
                return
            client.setblocking(False)
            self._clients[client.fileno()] = client
            self._epoll.register(client, select.EPOLLIN)

    def _answer(self, descriptor: int) -> None:
        client = self._clients[descriptor]
        try:
            # One byte more than permitted, so that `read_object` sees that a packet is too long; of a
            # SOCK_SEQPACKET the kernel discards the rest.
            packet = client.recv(REQUEST_LIMIT + 1)
            if packet:
                client.send(_packed(self._reply(packet)))
                return
        except OSError:  # the client has gone, or does not read its answers
            pass
        self._epoll.unregister(client)
        client.close()
        del self._clients[descriptor]

    def _reply(self, packet: bytes) -> Mapping[str, Any]:
        try:
            request = read_object(packet, REQUEST_LIMIT)
        except ValueError as error:
            return {"ok": False, "error": f"a command is a JSON object: {error}"}
        try:
            return self._obey(request)
        except UserError as error:
            return {"ok": False, "error": str(error)}

    def close(self) -> None:
        """Hang up and remove the socket."""
        for client in self._clients.values():
            client.close()
        self._clients.clear()
        self._epoll.close()
        self._listener.close()
        self._path.unlink(missing_ok=True)


def ask(path: Path, request: Mapping[str, Any]) -> dict[str, Any]:
    """The answer to one command; Refused with the reason if it was not obeyed."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as connection:
        connection.settimeout(ANSWER_S)
        try:
            connection.connect(_name(path))
            connection.send(_packed(request))
            answer = read_object(connection.recv(ANSWER_LIMIT), ANSWER_LIMIT)
        except TimeoutError as error:
            raise ControlUnavailable(f"{path}: no answer within {ANSWER_S:g} s; is it stopped?") from error
        except (FileNotFoundError, ConnectionRefusedError) as error:
            raise ControlUnavailable(
                f"{path}: nobody listens; start `loaderhil gateway --control {path}` first"
            ) from error
        except (OSError, ValueError) as error:
            raise ControlUnavailable(f"{path}: no control socket of a gateway: {error}") from error
    if not answer.get("ok"):
        raise Refused(str(answer.get("error", "refused without a reason")))
    return answer


def _packed(message: Mapping[str, Any]) -> bytes:
    return json.dumps(message).encode()


def _name(path: Path) -> str:
    if len(os.fsencode(path)) > PATH_LIMIT:
        raise ControlUnavailable(
            f"{path}: {len(os.fsencode(path))} bytes are too long for a socket's name, at most {PATH_LIMIT}"
        )
    return os.fspath(path)


def _listen(path: Path) -> socket.socket:
    name = _name(path)
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_NONBLOCK)
    try:
        try:
            listener.bind(name)
        except OSError as error:
            if error.errno != errno.EADDRINUSE:
                raise ControlUnavailable(f"{path}: no socket can be made here: {error.strerror}") from error
            _remove_stale(path)
            listener.bind(name)
        # whoever can write to the socket can falsify the bench: its owner only
        path.chmod(stat.S_IRUSR | stat.S_IWUSR)
        listener.listen(CLIENTS_LIMIT)
    except BaseException:
        listener.close()
        raise
    return listener


def _remove_stale(path: Path) -> None:
    """Remove the socket of a process that is gone; nothing else."""
    if not path.is_socket():
        raise ControlUnavailable(f"{path}: in the way, and not a socket; remove it or use another path")
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_NONBLOCK) as probe:
        if probe.connect_ex(os.fspath(path)) != errno.ECONNREFUSED:
            raise ControlUnavailable(f"{path}: somebody already listens there; use another path")
    path.unlink()
