"""The link between a process and systemd: ready, alive, stopping (sd_notify(3)). Without systemd nothing is sent.

A datagram to the socket that systemd names is the whole protocol, so no library is needed for it.
"""

import os
import socket
import time
from collections.abc import Mapping
from contextlib import suppress
from typing import Self

PINGS_PER_TIMEOUT = 4
"""sd_watchdog_enabled(3) asks for two; four leave room for one lost to a busy host."""


class ServiceManager:
    """Tells systemd how the service does; every method returns at once and raises nothing."""

    def __init__(self, address: str | None, watchdog_s: float | None) -> None:
        """address: path of systemd's socket, "@..." in the abstract name space; watchdog_s: None without a watchdog."""
        self._address = None if address is None else address.replace("@", "\0", 1)
        self._interval_ns = None if watchdog_s is None else round(watchdog_s * 1e9 / PINGS_PER_TIMEOUT)
        self._next_ns = 0
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
        # A tick must not wait for systemd.
        self._socket.setblocking(False)

    @classmethod
    def from_environment(cls, environment: Mapping[str, str] = os.environ) -> Self:
        """The link that systemd passed on; one that says nothing where there is none."""
        address = environment.get("NOTIFY_SOCKET")
        for_us = environment.get("WATCHDOG_PID") in (None, str(os.getpid()))
        timeout_us = environment.get("WATCHDOG_USEC", "")
        watched = for_us and timeout_us.isdecimal() and int(timeout_us) > 0
        return cls(address, int(timeout_us) * 1e-6 if watched else None)

    def ready(self, status: str) -> None:
        """The service works from now on; status: one line for `systemctl status`."""
        self._say(f"READY=1\nSTATUS={status}")

    def alive(self, now_ns: int | None = None) -> None:
        """To be called whenever the service has done its work; sends a ping when the last one is old enough."""
        if self._interval_ns is None:
            return
        now_ns = time.monotonic_ns() if now_ns is None else now_ns
        if now_ns >= self._next_ns:
            self._next_ns = now_ns + self._interval_ns
            self._say("WATCHDOG=1")

    def stopping(self) -> None:
        """The service ends in good order."""
        self._say("STOPPING=1")

    def close(self) -> None:
        """Release the socket."""
        self._socket.close()

    def _say(self, message: str) -> None:
        if self._address is not None:
            # A full or missing socket is systemd's trouble: the bus goes on, and the watchdog says the rest.
            with suppress(OSError):
                self._socket.sendto(message.encode(), self._address)
