"""A terminal for programs that want one."""

import contextlib
import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import termios
import time

from bus.frame import Frame
from bus.transport import Transport
from tests.bus.laws import WAIT_S


class Terminal:
    """A program on a terminal of its own, and all that it has written there."""

    def __init__(self, *command: str) -> None:
        self._master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 140, 0, 0))
        self.process = subprocess.Popen(
            command,
            stdin=slave,
            stdout=slave,
            stderr=slave,
            start_new_session=True,
            env={**os.environ, "TERM": "linux"},
        )
        os.close(slave)
        self.text = ""

    def read(self, timeout_s: float) -> None:
        """Take over what has been written, without the terminal's control sequences."""
        if select.select([self._master], [], [], timeout_s)[0]:
            with contextlib.suppress(OSError):  # the program has closed its side
                raw = os.read(self._master, 65536).decode(errors="replace")
                self.text += re.sub(r"\x1b[\[()][0-9;?]*[A-Za-z0-9]|\x1b[78=>]|[\x0e\x0f]", " ", raw)

    def type(self, keys: str) -> None:
        os.write(self._master, keys.encode())

    def end(self, keys: str = "q") -> int:
        """Give it the keys that end it, and read on until it has ended."""
        self.type(keys)
        deadline = time.monotonic() + WAIT_S
        while self.process.poll() is None and time.monotonic() < deadline:
            self.read(0.1)
        return self.process.wait(0)

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        os.close(self._master)


def feed_until_shown(sender: Transport, frame: Frame, screen: Terminal, *wanted: str) -> None:
    """Repeat a frame, as a bus does, until the screen has shown it."""
    deadline = time.monotonic() + WAIT_S
    while not all(text in screen.text for text in wanted):
        assert time.monotonic() < deadline, screen.text[-3000:]
        sender.send(frame)
        screen.read(0.05)
