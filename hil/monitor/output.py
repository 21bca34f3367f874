"""Standard output as a pipe's end: whole batches, a reader that goes away, a signal while it does not read."""

import errno
import os
import select
import stat
import sys

from hil.shell.process import Stop

_NOBODY = (errno.EPIPE, errno.EIO)  # a pipe's reader, a terminal


PATIENCE_S = 0.5
"""How long a reader that is only slow may take to read on after the signal to end."""


class Closed(Exception):
    """The reader of the pipe is gone, or a signal came while it did not read."""


class Output:
    """Writes text to a descriptor; never stuck behind a reader that has stopped reading."""

    def __init__(self, descriptor: int, stop: Stop) -> None:
        self.descriptor = descriptor
        self._piece = sys.maxsize if stat.S_ISREG(os.fstat(descriptor).st_mode) else select.PIPE_BUF
        self._poll = select.poll()
        self._poll.register(descriptor, select.POLLOUT)
        self._poll.register(stop.fileno(), select.POLLIN)

    @property
    def watchable(self) -> tuple[int, ...]:
        """The descriptor, if its reader's end can be noticed without writing."""
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
