"""A serial CAN adapter of our own: the kernel's slcan driver with a pseudo-terminal in the place of the device.

The driver speaks the text protocol of such adapters (LAWICEL). Error frames, bus-off, carrier and transmit queue are the kernel's own.
"""

import fcntl
import os
import pty
import struct
import threading
import time
import tty
from collections.abc import Callable

from bus.socketcan.link import can_interfaces
from tests.bus.laws import WAIT_S
from tests.bus.vcan import ip

TIOCSETD, N_SLCAN = 0x5423, 17  # include/uapi/asm-generic/ioctls.h, include/uapi/linux/tty.h


class Adapter:
    """A serial CAN adapter whose owner can say what it meets on the wire."""

    def __init__(self, taken: Callable[[bytes], None] | None = None) -> None:
        """taken: called with what the driver sends, from a thread, instead of keeping it in `sent`."""
        self._taken = taken
        self._ours, self._theirs = pty.openpty()
        tty.setraw(self._ours)
        tty.setraw(self._theirs)
        before = set(can_interfaces())
        fcntl.ioctl(self._theirs, TIOCSETD, struct.pack("i", N_SLCAN))
        (self.interface,) = set(can_interfaces()) - before
        self.sent = b""
        self._listening = threading.Event()
        self._listening.set()
        self._listener = threading.Thread(target=self._listen, name="adapter", daemon=True)
        self._listener.start()
        ip("link", "set", self.interface, "type", "can", "bitrate", "500000")
        ip("link", "set", self.interface, "up")
        if taken is None:
            self.read_until(b"S6\rO\r")

    def _listen(self) -> None:
        while self._listening.wait():
            try:
                text = os.read(self._ours, 4096)
            except OSError:  # closed
                return
            if self._taken is None:
                self.sent += text
            else:
                self._taken(text)

    def read_until(self, text: bytes) -> None:
        """Wait until the driver has sent this, and forget it."""
        deadline = time.monotonic() + WAIT_S
        while text not in self.sent:
            assert time.monotonic() < deadline, f"the driver has sent {self.sent!r}"
            time.sleep(0.01)
        self.sent = b""

    def says(self, text: bytes) -> None:
        """Tell the driver something, as an adapter does."""
        os.write(self._ours, text)

    def stall(self) -> None:
        """Take nothing from the driver, like a controller that finds the bus always busy."""
        self._listening.clear()

    def go_on(self) -> None:
        """Take from the driver again."""
        self._listening.set()

    def unplug(self) -> None:
        """Be gone, and the kernel's interface too; a second call does nothing."""
        if self._ours < 0:
            return
        self.go_on()
        os.close(self._theirs)
        # the interface goes with the last holder of the terminal: a listener that still reads would keep it
        self._listener.join(WAIT_S)
        os.close(self._ours)
        self._theirs = self._ours = -1
