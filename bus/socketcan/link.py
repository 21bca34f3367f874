"""CAN network interfaces for the SocketCAN transport: their names, their state, and waiting for a change.

Read through rtnetlink(7), which answers for the network namespace of this process. /sys/class/net would
answer for the namespace in which it was mounted, which differs inside a container.
"""

import errno
import fcntl
import socket
import struct
from dataclasses import dataclass
from typing import Self

_IFF_UP, _IFF_LOWER_UP = 0x1, 0x1_0000  # include/uapi/linux/if.h
_ARPHRD_CAN = 280  # include/uapi/linux/if_arp.h
_RTM_NEWLINK, _RTM_GETLINK = 16, 18  # include/uapi/linux/rtnetlink.h
_RTMGRP_LINK = 1
_NLM_F_REQUEST = 1  # include/uapi/linux/netlink.h
_SIOCGIFTXQLEN = 0x8942  # include/uapi/linux/sockios.h
_HEADER = struct.Struct("=IHHII")  # struct nlmsghdr: length, type, flags, sequence, port
_LINK = struct.Struct("=BxHiII")  # struct ifinfomsg: family, type, index, flags, change


@dataclass(frozen=True, slots=True)
class Link:
    """State of a network interface."""

    can: bool  # whether it is a CAN interface
    up: bool  # administratively up (ip link set up)
    carrier: bool  # also able to send; a controller that is bus off is up without carrier

    @classmethod
    def read(cls, name: str) -> Self | None:
        """Now; None if there is no such interface."""
        request = _LINK.pack(socket.AF_UNSPEC, 0, _index(name), 0, 0)
        header = _HEADER.pack(_HEADER.size + len(request), _RTM_GETLINK, _NLM_F_REQUEST, 0, 0)
        with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE) as kernel:
            kernel.send(header + request)
            answer = kernel.recv(65536)
        if _HEADER.unpack_from(answer)[1] != _RTM_NEWLINK:
            return None
        _, kind, _, flags, _ = _LINK.unpack_from(answer, _HEADER.size)
        return cls(kind == _ARPHRD_CAN, bool(flags & _IFF_UP), bool(flags & _IFF_LOWER_UP))


def _index(name: str) -> int:
    """Number of an interface; one that no interface has if there is none of that name."""
    try:
        return socket.if_nametoindex(name)
    except OSError:
        # the kernel then answers with an error message, the same path as for an interface that vanishes in between
        return 2**31 - 1


def can_interfaces() -> list[str]:
    """Names of the CAN interfaces of this network namespace."""
    links = {name: Link.read(name) for _, name in socket.if_nameindex()}
    return sorted(name for name, link in links.items() if link and link.can)


def queue_length(name: str) -> int:
    """Frames that the interface takes before its controller has sent one (txqueuelen)."""
    request = struct.pack("16si12x", name.encode(), 0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        # interface ioctls work on any socket; by netlink the length would have to be searched among the attributes
        answer = fcntl.ioctl(any_socket, _SIOCGIFTXQLEN, request)
    return int(struct.unpack_from("i", answer, 16)[0])


class LinkWatch:
    """A descriptor that becomes readable when any network interface changes."""

    def __init__(self) -> None:
        self._socket = socket.socket(
            socket.AF_NETLINK, socket.SOCK_RAW | socket.SOCK_NONBLOCK, socket.NETLINK_ROUTE
        )
        # the kernel multicasts every change of an interface to this group, without privilege
        self._socket.bind((0, _RTMGRP_LINK))

    def fileno(self) -> int:
        """The descriptor to wait on."""
        return self._socket.fileno()

    def clear(self) -> None:
        """Forget the changes so far; what they were is seen by looking at the interface."""
        while True:
            try:
                self._socket.recv(65536)
            except BlockingIOError:
                return
            except OSError as error:
                # ENOBUFS: more changes than its buffer holds; harmless, because the state is read anew
                if error.errno != errno.ENOBUFS:
                    raise

    def close(self) -> None:
        """Stop watching."""
        self._socket.close()
