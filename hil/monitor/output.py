"""Writes standard output for the monitor: ends when the reader goes away, or at a signal while it does not read."""

import errno
import os
import select
import stat
import sys

from hil.shell.process import Stop

_NOBODY = (errno.EPIPE, errno.EIO)  # the reader of a pipe has gone; the terminal has gone


PATIENCE_S = 0.5
"""Time that a slow reader gets after the signal to end before the rest is dropped [s]."""


class Closed(Exception):
    """The reader of the pipe is gone, or a signal came while it did not read."""


class Output:
    """Writes text to a descriptor without blocking for ever on a reader that has stopped reading."""

    def __init__(self, descriptor: int, stop: Stop) -> None:
        self.descriptor = descriptor
        # poll says "writable" for PIPE_BUF bytes; a longer write to a pipe may block
        self._piece = sys.maxsize if stat.S_ISREG(os.fstat(descriptor).st_mode) else select.PIPE_BUF
        self._poll = select.poll()
        self._poll.register(descriptor, select.POLLOUT)
        self._poll.register(stop.fileno(), select.POLLIN)

    @property
    def watchable(self) -> tuple[int, ...]:
        """The descriptor, if poll reports the end of its reader without a write; () otherwise."""
        mode = os.fstat(self.descriptor).st_mode
        return (self.descriptor,) if stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode) else ()

    def write(self, text: str) -> None:
        """All of `text`, unless Closed."""
        rest = memoryview(text.encode())
        while rest:
            ready = {number for number, _ in self._poll.poll()}
            if self.descriptor not in ready and not self._ready_after_all():
                raise Closed
            try:
                rest = rest[os.write(self.descriptor, rest[: self._piece]) :]
            except OSError as error:
                if error.errno not in _NOBODY:
                    raise
                raise Closed from error

    def _ready_after_all(self) -> bool:
        writable = select.poll()
        writable.register(self.descriptor, select.POLLOUT)
        return bool(writable.poll(PATIENCE_S * 1e3))
