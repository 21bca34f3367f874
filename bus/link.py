"""CAN network interfaces: which there are, whether they are up, and waiting for a change."""

import contextlib
import fcntl
import socket
import struct
from pathlib import Path

_SIOCGIFFLAGS = 0x8913  # include/uapi/linux/sockios.h
_IFF_UP = 0x1
_ARPHRD_CAN = "280"  # include/uapi/linux/if_arp.h
_RTMGRP_LINK = 1  # include/uapi/linux/rtnetlink.h


def can_interfaces() -> list[str]:
    """Names of the CAN interfaces of this network namespace."""
    kinds = Path("/sys/class/net").glob("*/type")
    return sorted(kind.parent.name for kind in kinds if kind.read_text().strip() == _ARPHRD_CAN)


def is_up(name: str) -> bool:
    """Whether the interface exists and is up."""
    request = struct.pack("16sH14x", name.encode(), 0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        try:
            answer = fcntl.ioctl(any_socket, _SIOCGIFFLAGS, request)
        except OSError:
            return False
    return bool(struct.unpack_from("H", answer, 16)[0] & _IFF_UP)


class LinkWatch:
    """A descriptor that becomes readable when any network interface changes."""

    def __init__(self) -> None:
        self._socket = socket.socket(
            socket.AF_NETLINK, socket.SOCK_RAW | socket.SOCK_NONBLOCK, socket.NETLINK_ROUTE
        )
        self._socket.bind((0, _RTMGRP_LINK))

    def fileno(self) -> int:
        """The descriptor to wait on."""
        return self._socket.fileno()

    def clear(self) -> None:
        """Forget the changes so far; what they were is seen by looking at the interface."""
        with contextlib.suppress(BlockingIOError):
            while self._socket.recv(65536):
                pass

    def close(self) -> None:
        """Stop watching."""
        self._socket.close()
