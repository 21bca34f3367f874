"""The link between the supervisor and one of its processes: a socket pair with one JSON object per line.

The process sends ready, progress, waited, note, action, finished or error; the supervisor sends go. Either side
sees the end of file when the other is gone. A process started by hand has no link: the
same calls then print, or do nothing.
"""

import ctypes
import json
import os
import signal
import socket
import sys
from typing import Any, Self

PR_SET_PDEATHSIG = 1  # include/uapi/linux/prctl.h
FD_VARIABLE = "LOADERHIL_LIFELINE"
"""Environment variable with the file descriptor and the supervisor's process id, `FD:PID`."""


class SupervisorGone(ConnectionError):
    """The supervisor ended before it sent go."""


class Lifeline:
    """The process' end of the link."""

    def __init__(self, link: socket.socket | None) -> None:
        self._link = link

    @classmethod
    def from_environment(cls) -> Self:
        """The link that the supervisor passed on, or none; with it, this process dies when the other does."""
        passed = os.environ.pop(FD_VARIABLE, None)
        if passed is None:
            return cls(None)
        descriptor, parent = (int(part) for part in passed.split(":"))
        die_with_parent(parent)
        return cls(socket.socket(fileno=descriptor))

    @property
    def supervised(self) -> bool:
        """Whether a supervisor listens."""
        return self._link is not None

    def ready(self) -> None:
        """Report that everything is loaded and compiled and the bus is open."""
        self._say({"event": "ready"})

    def wait_for_go(self) -> None:
        """Block until the supervisor sends go; without one, return at once."""
        if self._link is not None and not self._link.recv(16):
            raise SupervisorGone("the supervisor ended before it said go")

    def progress(self, time_s: float, of_s: float) -> None:
        """Report the simulated time reached, of the time planned [s]."""
        self._say({"event": "progress", "time_s": time_s, "of_s": of_s})

    def waited(self, from_ns: int, until_ns: int, waited_ns: int) -> None:
        """Report that between two times this process waited `waited_ns` for a processor [ns]."""
        self._say({"event": "waited", "row": (from_ns, until_ns, waited_ns)})

    def act(self, kind: str, target: str) -> None:
        """Ask the supervisor to do something to another process: kill or restart."""
        self._say({"event": "action", "kind": kind, "target": target})

    def note(self, message: str) -> None:
        """Report an event to the user at once; printed where there is no supervisor."""
        if self._link is None:
            print(f"loaderhil: {message}", file=sys.stderr)
        self._say({"event": "note", "message": message})

    def fileno(self) -> int:
        """Readable when the supervisor has sent go, or is gone; only under a supervisor."""
        if self._link is None:
            raise ValueError("there is no supervisor to listen to")
        return self._link.fileno()

    def finished(self, *, complete: bool, **figures: Any) -> None:
        """Report the end: whether the work is complete, and figures for the run's record."""
        self._say({"event": "finished", "complete": complete, "figures": figures})

    def error(self, message: str) -> None:
        """Report why this process ends early: to the supervisor, or to standard error without one."""
        if self._link is None:
            print(f"loaderhil: {message}", file=sys.stderr)
        self._say({"event": "error", "message": message})

    def _say(self, event: dict[str, Any]) -> None:
        if self._link is None:
            return
        try:
            self._link.sendall(json.dumps(event).encode() + b"\n")
        except (BrokenPipeError, ConnectionResetError):
            self._link = None  # the supervisor is gone and its death signal is on its way


def die_with_parent(parent: int) -> None:
    """Ask the kernel for SIGTERM when the parent dies, however it dies."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(PR_SET_PDEATHSIG, signal.SIGTERM) != 0:
        raise OSError(ctypes.get_errno(), "prctl(PR_SET_PDEATHSIG) failed")
    if os.getppid() != parent:  # it died before the prctl: no signal will come for that
        os.kill(os.getpid(), signal.SIGTERM)
