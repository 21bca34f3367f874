"""What lies between the ECU's interface and the machine's: the kernel's own gateway, or a serial adapter that can be bus off."""

import fcntl
import socket
import struct
import subprocess
import threading
import time
from typing import Self

from bus.frame import EXTENDED, EXTENDED_MASK, Frame
from bus.socketcan.transport import SocketCanTransport
from tests.bus.slcan import Adapter
from tests.bus.vcan import ip

MACHINE, ECU = "vcan1", "vcan0"
_SIOCSIFFLAGS = 0x8914  # include/uapi/linux/sockios.h
_RTM_DELLINK, _NLM_F_REQUEST = 17, 1  # include/uapi/linux/rtnetlink.h, netlink.h
_HEADER, _LINK = struct.Struct("=IHHII"), struct.Struct("=BxHiII")  # struct nlmsghdr, struct ifinfomsg


class KernelWire:
    """Two virtual interfaces joined by can-gw. That of the ECU can go down or away while the machine's stays up."""

    interface = ECU

    def __enter__(self) -> Self:
        self._join()
        return self

    def _join(self) -> None:
        for source, target in ((ECU, MACHINE), (MACHINE, ECU)):
            subprocess.run(["cangw", "-A", "-s", source, "-d", target, "-e"], check=True)

    def __exit__(self, *_: object) -> None:
        subprocess.run(["cangw", "-F"], check=False)

    def down(self) -> None:
        """Set the ECU's interface down."""
        # a call and not `ip`: the moment of the event is then known, where a process takes its time to start
        request = struct.pack("16sh22x", ECU.encode(), 0)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
            fcntl.ioctl(any_socket, _SIOCSIFFLAGS, request)

    def up(self) -> None:
        """Set it up again."""
        ip("link", "set", ECU, "up")

    def remove(self) -> None:
        """Remove it, as an adapter that is unplugged."""
        link = _LINK.pack(socket.AF_UNSPEC, 0, socket.if_nametoindex(ECU), 0, 0)
        header = _HEADER.pack(_HEADER.size + len(link), _RTM_DELLINK, _NLM_F_REQUEST, 0, 0)
        with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE) as kernel:
            kernel.send(header + link)

    def plug(self) -> None:
        """Make it anew."""
        ip("link", "add", "dev", ECU, "type", "vcan")
        ip("link", "set", ECU, "up")
        subprocess.run(["cangw", "-F"], check=False)
        self._join()


class SerialWire:
    """A serial adapter of our own at the ECU, and the machine's interface behind it."""

    def __enter__(self) -> Self:
        self._bus = SocketCanTransport(MACHINE)
        self._off = False
        self._stop = threading.Event()
        self._rest = b""
        self._adapter = Adapter(self._taken)
        self.interface = self._adapter.interface
        self._thread = threading.Thread(target=self._to_the_ecu, name="wire", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(5.0)
        self._adapter.unplug()  # before the bus: until then the driver's frames go to it
        self._bus.close()

    def _to_the_ecu(self) -> None:
        while not self._stop.is_set():
            frames = self._bus.drain()
            if frames and not self._off:
                # one write for all that came: each is a call of the terminal's driver
                self._adapter.says(b"".join(written(frame) for frame in frames))
            elif not frames:
                time.sleep(0.001)

    def _taken(self, text: bytes) -> None:
        *whole, self._rest = (self._rest + text).split(b"\r")
        for each in whole:
            if each[:1] in (b"t", b"T") and not self._off:
                self._bus.send(read(each))

    def bus_off(self) -> None:
        """The controller has counted 256 errors: it takes part no more."""
        self._off = True
        self._adapter.says(b"sb255255\r")

    def restart(self) -> None:
        """Start the controller again, as `restart-ms` does on controllers whose driver can."""
        ip("link", "set", self.interface, "down")
        ip("link", "set", self.interface, "up")
        self._off = False


def written(frame: Frame) -> bytes:
    """A frame as the adapter writes it."""
    extended = bool(frame.can_id & EXTENDED)
    word = b"T%08X" if extended else b"t%03X"
    return word % (frame.can_id & EXTENDED_MASK) + b"%d%s\r" % (
        len(frame.data),
        frame.data.hex().upper().encode(),
    )


def read(text: bytes) -> Frame:
    """A frame as the driver writes it, without the line's end."""
    digits = 8 if text[:1] == b"T" else 3
    can_id = int(text[1 : 1 + digits], 16) | (EXTENDED if digits == 8 else 0)
    return Frame(can_id, bytes.fromhex(text[2 + digits :].decode()))
