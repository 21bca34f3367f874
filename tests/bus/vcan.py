"""Virtual CAN interfaces for tests, and how to look at what the kernel does with them."""

import subprocess
from pathlib import Path

from bus.errors import BusFinding, Fault
from bus.socketcan.transport import SocketCanTransport
from tests.bus.laws import WAIT_S, readable

ROOT = Path(__file__).resolve().parents[2]
INTERFACE = "vcan0"


class Vcan:
    """SocketCAN for the laws of transports."""

    # The difference of the two clocks is measured to well below this, even under user-mode Linux.
    slack_ns = 200_000

    def connect(self) -> SocketCanTransport:
        return SocketCanTransport(INTERFACE)


def ip(*arguments: str) -> None:
    """The program ip."""
    subprocess.run(["ip", *arguments], check=True)


def kinds(findings: list[BusFinding]) -> list[Fault]:
    """What was found, without when and how."""
    return [finding.fault for finding in findings]


def wait_until(receiver: SocketCanTransport, *, up: bool) -> None:
    """Drain as an event loop would, until the interface is seen in that state."""
    while receiver.link_up is not up:
        assert readable(receiver, WAIT_S), f"no notice that {receiver.interface} changed"
        receiver.drain()


def listeners() -> int:
    """Sockets of this machine that receive everything from the interface, as the kernel lists them."""
    return Path("/proc/net/can/rcvlist_all").read_text().count(f" {INTERFACE} ")
