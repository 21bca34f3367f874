"""A hub on a thread of this process, and clients that speak its protocol by hand."""

import socket
import sys
import threading

from bus.hub import packet
from bus.hub.client import HubTransport
from bus.hub.server import Hub
from tests.bus.laws import WAIT_S


class RunningHub:
    """A hub on a thread."""

    slack_ns = 0

    def __init__(self, path: str, **options: int) -> None:
        self.path = path
        self.hub = Hub(path, **options)
        self._thread = threading.Thread(target=self.hub.run, name="hub", daemon=True)
        self._thread.start()

    def connect(self) -> HubTransport:
        return HubTransport(self.path)

    def stop(self) -> None:
        self.hub.stop()
        self._thread.join(WAIT_S)
        assert not self._thread.is_alive()
        self.hub.close()


def raw(path: str) -> socket.socket:
    """A client that speaks the protocol by hand."""
    client = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    client.settimeout(WAIT_S)
    client.connect(path)
    return client


def hear(client: socket.socket) -> dict[str, object]:
    """The control message that comes next."""
    head = client.recv(packet.SIZE, socket.MSG_PEEK)
    return packet.read_control(client.recv(packet.control_size(head)))


def greet(client: socket.socket, name: str) -> None:
    """Become a client of the hub."""
    client.send(packet.control({"hello": name, "protocol": packet.PROTOCOL}))
    assert hear(client) == {"welcome": packet.PROTOCOL}


def saying(text: bytes) -> bytes:
    """A control message with any text."""
    head = bytearray(packet.control({})[: packet.SIZE])
    head[:4] = len(text).to_bytes(4, sys.byteorder)
    return bytes(head) + text.ljust(-(-len(text) // packet.SIZE) * packet.SIZE, b"\0")
