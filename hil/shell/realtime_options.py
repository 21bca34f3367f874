"""Real-time options of a process: priority, locked memory, one processor, no garbage collection of old objects.

sched(7), mlockall(2), gc of Python. A refused request is an error, not a warning: without it the run would be judged
under conditions that the user did not choose.
"""

import ctypes
import errno
import gc
import os
import resource
from dataclasses import dataclass
from typing import Annotated

import typer

from bus.user_error import UserError

PRIORITIES = (1, 99)
"""Of SCHED_FIFO, the highest last (sched_get_priority_min and _max of Linux)."""
_MCL_CURRENT, _MCL_FUTURE = 1, 2  # include/uapi/asm-generic/mman.h

FifoOption = Annotated[
    int | None,
    typer.Option(
        "--fifo",
        metavar="PRIORITY",
        min=PRIORITIES[0],
        max=PRIORITIES[1],
        help="Real-time priority (SCHED_FIFO), 1 to 99; a higher number runs first.",
    ),
]
LockOption = Annotated[
    bool, typer.Option("--lock-memory", help="Lock all memory, so that no tick waits for a page fault.")
]
CpuOption = Annotated[
    int | None,
    typer.Option("--cpu", metavar="N", min=0, max=8191, help="Run only on processor N, counted from 0."),
]
FreezeOption = Annotated[
    bool,
    typer.Option(
        "--gc-freeze/--no-gc-freeze",
        help="Exclude the objects created at start-up from Python's garbage collection.",
    ),
]


class RealtimeRefused(UserError, ValueError):
    """The kernel does not grant what was asked for; the message says why and what would help."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RealtimeOptions:
    """The options as chosen by the user."""

    fifo: int | None = None  # priority of SCHED_FIFO; None: an ordinary process
    lock_memory: bool = False
    cpu: int | None = None  # number of the only processor; None: any
    gc_freeze: bool = True

    def words(self, *, above: int = 0) -> list[str]:
        """The same options as words of a command line. above: added to the priority."""
        fifo = None if self.fifo is None else min(self.fifo + above, PRIORITIES[1])
        return [
            *(["--fifo", str(fifo)] if fifo is not None else []),
            *(["--lock-memory"] if self.lock_memory else []),
            *(["--cpu", str(self.cpu)] if self.cpu is not None else []),
            *([] if self.gc_freeze else ["--no-gc-freeze"]),
        ]

    def apply(self) -> None:
        """Apply all options to the calling thread; RealtimeRefused names the first refusal.

        Call it when everything is loaded and compiled: objects made later are not frozen.
        """
        if self.cpu is not None:
            _keep_to(self.cpu)
        if self.gc_freeze:
            gc.collect()
            gc.freeze()
        if self.lock_memory:
            _lock_memory()
        if self.fifo is not None:
            _run_first(self.fifo)


ORDINARY = RealtimeOptions()


def _keep_to(cpu: int) -> None:
    try:
        os.sched_setaffinity(0, {cpu})
    except OSError as error:
        allowed = ", ".join(map(str, sorted(os.sched_getaffinity(0))))
        raise RealtimeRefused(
            f"--cpu {cpu}: this process may not run there ({error.strerror}); "
            f"it may on {allowed}: the machine has {os.cpu_count()} processors, and taskset or a container may leave fewer"
        ) from error


def _lock_memory() -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(_MCL_CURRENT | _MCL_FUTURE) == 0:
        return
    number = ctypes.get_errno()
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    if number in (errno.EPERM, errno.ENOMEM) and limit != resource.RLIM_INFINITY:
        cause = f"this user may lock {limit / 1024:.0f} KiB, and the process is larger"
    else:
        cause = os.strerror(number)
    raise RealtimeRefused(
        f"--lock-memory: {cause}; raise the limit (memlock in /etc/security/limits.conf, or ulimit -l), "
        "run as root, or leave the option out"
    )


def _run_first(priority: int) -> None:
    parameters = os.sched_param(priority)
    try:
        # RESET_ON_FORK: children, such as the recorder's writer, must not inherit the priority
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, parameters)
    except OSError as error:
        limit = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
        if error.errno == errno.EPERM and limit < priority:
            cause = f"this user's highest real-time priority is {limit}"
        else:
            cause = f"{error.strerror}, which a container or a control group without real-time does"
        raise RealtimeRefused(
            f"--fifo {priority}: {cause}; raise the limit (rtprio in /etc/security/limits.conf, or ulimit -r), "
            "run as root, or leave the option out"
        ) from error
