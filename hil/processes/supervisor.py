"""Starts the processes of a run, waits until they are ready, detects the first that ends, and ends all others.

Processes are watched by pidfd, so an end is seen at once and a process id can never be
mistaken for another's. Each has its own process group: Ctrl-C on the terminal reaches the
supervisor alone, which then stops the others in order. If the supervisor itself is
killed, the kernel signals its children (see lifeline).
"""

import contextlib
import json
import os
import selectors
import signal
import socket
import subprocess
import sys
import time
from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from bus.closing import Closing
from hil.shell.lifeline import FD_VARIABLE

Event = dict[str, Any]
STOP_S = 3.0
"""How long a process may take to end after SIGTERM before SIGKILL."""


@dataclass(slots=True, eq=False)
class Child:
    """One supervised process."""

    name: str
    command: Sequence[str]
    environment: Mapping[str, str] | None  # added to ours
    process: subprocess.Popen[bytes]
    link: socket.socket  # our end of its lifeline
    pidfd: int
    ready: bool = False
    finished: bool = False  # its work is done
    error: str = ""  # reported before it ended
    figures: Event = field(default_factory=dict)  # that it measured
    # waits for a processor, three numbers each, see `hil.timing.waits`
    waits: "array[int]" = field(default_factory=lambda: array("q"))
    silent: bool = False  # it closed its lifeline
    reached_s: float = 0.0  # simulated time that it last reported [s]
    vital: bool = False  # the run ends with it, even if a fault killed it
    condemned: bool = False  # killed by an injected fault
    _unread: bytes = b""  # the begin of a line whose end has not arrived

    @property
    def ended(self) -> bool:
        """Whether the process is gone."""
        return self.process.poll() is not None

    def how_it_ended(self) -> str:
        """One sentence about its end."""
        code = self.process.poll()
        who = f"the {self.name} process ({self.process.pid})"
        if code is None:
            return f"{who} is still running"
        if code < 0:
            asked = " for an injected fault" if self.condemned else ""
            return f"{who} was killed by {signal.Signals(-code).name}{asked}"
        return f"{who} ended with exit code {code}" + (f": {self.error}" if self.error else "")

    def events(self) -> list[Event]:
        """The events that the process sent since the last call."""
        try:
            while chunk := self.link.recv(65536, socket.MSG_DONTWAIT):
                self._unread += chunk
            self.silent = True
        except BlockingIOError:
            pass
        except ConnectionResetError:
            self.silent = True
        *lines, self._unread = self._unread.split(b"\n")
        return [json.loads(line) for line in lines]


class StartFailed(RuntimeError):
    """A process did not become ready; the message names it and gives its reason."""

    def __init__(self, message: str, ended: Child | None = None) -> None:
        """ended: the process that ended, None if one only took too long."""
        super().__init__(message)
        self.ended = ended


class Supervisor(Closing):
    """A group of processes that live and die together; use it as a context manager."""

    def __init__(self, on_event: Callable[[str, Event], None] | None = None) -> None:
        self._on_event = on_event
        self._selector = selectors.DefaultSelector()
        self.children: list[Child] = []

    def start(
        self,
        name: str,
        command: Sequence[str],
        environment: Mapping[str, str] | None = None,
        *,
        vital: bool = False,
    ) -> Child:
        """Start `command`; it finds its lifeline in the environment.

        vital: a fault that kills it ends the run.
        """
        ours, theirs = socket.socketpair()
        with theirs:
            process = subprocess.Popen(
                list(command),
                stdin=subprocess.DEVNULL,
                pass_fds=(theirs.fileno(),),
                process_group=0,
                env={**os.environ, **(environment or {}), FD_VARIABLE: f"{theirs.fileno()}:{os.getpid()}"},
            )
        child = Child(
            name=name,
            command=command,
            environment=environment,
            process=process,
            link=ours,
            # while Popen has not been waited for, the id cannot have been given to another process
            pidfd=os.pidfd_open(process.pid),
            vital=vital,
        )
        self.children.append(child)
        self._selector.register(child.link, selectors.EVENT_READ, child)
        self._selector.register(child.pidfd, selectors.EVENT_READ, child)
        return child

    def wait_ready(self, children: Sequence[Child], timeout_s: float) -> None:
        """Until every one of `children` said ready; StartFailed if one ends or takes too long."""
        deadline = time.monotonic() + timeout_s
        while not all(child.ready for child in children):
            self._listen(deadline - time.monotonic())
            gone = self._first_gone()
            if gone is not None:
                raise StartFailed(gone.how_it_ended(), gone)
            if time.monotonic() > deadline:
                late = ", ".join(child.name for child in children if not child.ready)
                raise StartFailed(f"not ready after {timeout_s:.0f} s: {late}; is the machine overloaded?")

    def kill(self, name: str) -> None:
        """Kill the process of that name for an injected fault; the run goes on unless the process is vital."""
        for child in self.children:
            if child.name == name and not child.ended:
                child.condemned = True
                self._signal(child, signal.SIGKILL)

    def restart(self, name: str) -> None:
        """Start the process of that name again as it was, unless one runs."""
        of_name = [child for child in self.children if child.name == name]
        if of_name and all(child.ended or child.condemned for child in of_name):
            self.start(name, of_name[-1].command, of_name[-1].environment)

    def go(self, child: Child) -> None:
        """Let a process that is ready begin."""
        child.link.sendall(b"go\n")

    def wait_first_end(self, timeout_s: float) -> Child | None:
        """The first child to end, or None after `timeout_s`; events are passed on meanwhile."""
        deadline = time.monotonic() + timeout_s
        while (left := deadline - time.monotonic()) > 0:
            gone = self._first_gone()
            if gone is not None:
                # its last words, such as an error, may still be in the socket
                self._listen(0)
                return gone
            self._listen(left)
        return None

    def _first_gone(self) -> Child | None:
        ended = (child for child in self.children if child.ended and (child.vital or not child.condemned))
        return next(ended, None)

    def wait_end(self, child: Child, timeout_s: float) -> None:
        """Until `child` has ended, at most `timeout_s`."""
        deadline = time.monotonic() + timeout_s
        while not child.ended and (left := deadline - time.monotonic()) > 0:
            self._listen(left)

    def _listen(self, timeout_s: float) -> None:
        for key, _ in self._selector.select(max(timeout_s, 0)):
            child: Child = key.data
            if key.fileobj == child.pidfd:
                self._selector.unregister(child.pidfd)
                child.process.wait()
            self._take(child)

    def _take(self, child: Child) -> None:
        """Store the events of a child and pass them on."""
        for event in child.events():
            match event["event"]:
                case "ready":
                    child.ready = True
                case "finished":
                    child.finished = event["complete"]
                    child.figures = event["figures"]
                case "progress":
                    child.reached_s = event["time_s"]
                case "waited":
                    child.waits.extend(event["row"])
                case "error":
                    child.error = event["message"]
                case "action":
                    {"kill": self.kill, "restart": self.restart}[event["kind"]](event["target"])
            if self._on_event is not None:
                self._on_event(child.name, event)
        if child.silent and child.link in self._selector.get_map():
            self._selector.unregister(child.link)

    def stop(self, child: Child, timeout_s: float = STOP_S) -> None:
        """End one process: SIGTERM, and SIGKILL if it has not ended after `timeout_s`."""
        if not child.ended:
            self._signal(child, signal.SIGTERM)
            try:
                child.process.wait(timeout_s)
            except subprocess.TimeoutExpired:
                self._signal(child, signal.SIGKILL)
                child.process.wait()
        self._take(child)

    @staticmethod
    def _signal(child: Child, number: signal.Signals) -> None:
        with contextlib.suppress(ProcessLookupError):  # it ended by itself meanwhile
            signal.pidfd_send_signal(child.pidfd, number)

    def stop_all(self) -> None:
        """End what still runs, the last started first; nothing is left when this returns."""
        try:
            for child in reversed(self.children):
                self.stop(child)
        finally:
            for child in self.children:  # a second Ctrl-C interrupts the loop above: no more waiting
                if not child.ended:
                    self._signal(child, signal.SIGKILL)
                    child.process.wait()

    def close(self) -> None:
        """Stop everything and release the descriptors."""
        try:
            self.stop_all()
        finally:
            self._selector.close()
            for child in self.children:
                child.link.close()
                os.close(child.pidfd)
            self.children.clear()


def loaderhil(*arguments: str) -> list[str]:
    """The command that runs `loaderhil ARGUMENTS` with this very interpreter."""
    return [sys.executable, "-m", "loaderhil", *arguments]
