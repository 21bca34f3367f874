"""Opens a raw CAN socket on an interface; one clear error for each reason why that can fail."""

import errno
import socket

from bus.socketcan.link import Link, can_interfaces, queue_length
from bus.transport import BusUnavailable

_NO_CAN = (errno.EAFNOSUPPORT, errno.EPROTONOSUPPORT, errno.ESOCKTNOSUPPORT)


def can_socket(interface: str) -> socket.socket:
    """A raw CAN socket that never blocks; BusUnavailable if this process cannot have one."""
    try:
        return socket.socket(socket.AF_CAN, socket.SOCK_RAW | socket.SOCK_NONBLOCK, socket.CAN_RAW)
    except OSError as error:
        if error.errno in _NO_CAN:
            why = (
                "this kernel has no CAN; load its modules (sudo modprobe can_raw), use a hub instead "
                "(--bus hub:PATH), or run under scripts/uml-run"
            )
        elif isinstance(error, PermissionError):
            why = "this process may not open CAN sockets; does a container or a security policy forbid them?"
        else:
            why = f"no CAN socket can be had: {error.strerror}"
        raise BusUnavailable(f"socketcan:{interface}: {why}") from error


def kernel_has_can() -> bool:
    """Whether this process can have raw CAN sockets."""
    try:
        can_socket("").close()
    except BusUnavailable:
        return False
    return True


def bind(can: socket.socket, interface: str) -> None:
    """Attach to the interface; BusUnavailable if there is no CAN interface of that name."""
    try:
        # ENODEV covers both "no such interface" and "not a CAN interface"; the list shows which it is
        can.bind((interface,))
    except OSError as error:
        there = ", ".join(can_interfaces()) or "none"
        raise BusUnavailable(
            f"socketcan:{interface}: no such CAN interface (there are: {there}); {_how_to_get(interface)}"
        ) from error


def require_up(interface: str) -> Link:
    """State of the interface; BusUnavailable if it is down."""
    link = Link.read(interface)
    if link is None or not link.up:
        raise BusUnavailable(f"socketcan:{interface}: it is down; bring it up: {_how_to_bring_up(interface)}")
    return link


def longer_queue(interface: str) -> str:
    """The interface, and advice for frames that come faster than the controller sends them."""
    try:
        length = queue_length(interface)
    except OSError:  # it has just been removed
        return interface
    return f"{interface} takes {length} at once; for bursts: sudo ip link set {interface} txqueuelen 1000"


def _how_to_get(interface: str) -> str:
    if interface.startswith("vcan"):
        return "sudo scripts/vcan-up makes virtual ones"
    return "is the adapter plugged in, and its driver loaded?"


def _how_to_bring_up(interface: str) -> str:
    if interface.startswith("v"):  # vcan, vxcan: no wire, no bit rate
        return f"sudo ip link set {interface} up"
    return f"sudo ip link set {interface} up type can bitrate 500000"
