"""Why a CAN socket cannot be had, for every cause that the kernel gives."""

import errno
import os
import socket

import pytest

from bus.socketcan.can_socket import can_socket, kernel_has_can
from bus.transport import BusUnavailable


@pytest.mark.parametrize(
    ("number", "says"),
    [
        (
            errno.EAFNOSUPPORT,
            "socketcan:can0: this kernel has no CAN; load its modules (sudo modprobe can_raw)",
        ),
        (errno.EPROTONOSUPPORT, "this kernel has no CAN"),
        (errno.EPERM, "this process may not open CAN sockets; does a container or a security policy forbid"),
        (errno.EACCES, "this process may not open CAN sockets"),
        (errno.EMFILE, "no CAN socket can be had: Too many open files"),
    ],
)
def test_the_cause_and_what_helps(monkeypatch: pytest.MonkeyPatch, number: int, says: str) -> None:
    def refuse(*_: int) -> socket.socket:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("bus.socketcan.can_socket.socket.socket", refuse)
    with pytest.raises(BusUnavailable) as caught:
        can_socket("can0")
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not kernel_has_can()
