"""For every process that ticks on a bus: waiting for a descriptor, and recording the times of its own ticks."""

import asyncio
from array import array
from collections.abc import Callable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Error = TypeVar("Error", bound=BaseException)


class TickTiming:
    """Receives every tick of a process; keeps only the count of missed ticks, so memory does not grow with the run."""

    def __init__(self) -> None:
        self.missed = 0

    def add(self, due_ns: int, started_ns: int, ended_ns: int) -> None:
        """One tick: when it should have started, when it did, and when it ended."""


class KeptTiming(TickTiming):
    """Keeps every tick in memory, for runs of known length."""

    def __init__(self) -> None:
        super().__init__()
        # an array of 64-bit integers: 24 bytes a tick, where a list of tuples takes more than 150
        self._rows = array("q")

    def add(self, due_ns: int, started_ns: int, ended_ns: int) -> None:
        """One tick."""
        self._rows.extend((due_ns, started_ns, ended_ns))

    def columns(self) -> dict[str, NDArray[np.int64]]:
        """Columns for timing.npz."""
        return columns_of(np.array(self._rows, np.int64).reshape(-1, 3))


def columns_of(rows: NDArray[np.int64]) -> dict[str, NDArray[np.int64]]:
    """rows: (n, 3) due, start and end of each tick [ns]; its due time, lateness and execution [ns]."""
    due, started, ended = rows.T
    return {"due_ns": due, "lateness_ns": started - due, "execution_ns": ended - started}


async def readable(fd: int) -> None:
    """Wait until `fd` has something to read."""
    loop = asyncio.get_running_loop()
    ready = asyncio.Event()
    loop.add_reader(fd, ready.set)
    try:
        await ready.wait()
    finally:
        loop.remove_reader(fd)


async def reading(fd: int, read: Callable[[], None]) -> None:
    """Call `read` whenever `fd` has something to read, until it raises, which this then does.

    The descriptor stays registered and nothing is awaited in between: a fifth of the CPU time of
    waiting with `readable` anew each time.
    """
    loop = asyncio.get_running_loop()
    failed: asyncio.Future[None] = loop.create_future()

    def ready() -> None:
        try:
            read()
        except Exception as error:
            loop.remove_reader(fd)
            failed.set_exception(error)

    loop.add_reader(fd, ready)
    try:
        await failed
    finally:
        loop.remove_reader(fd)


def first_of(group: BaseExceptionGroup[Error]) -> Error:
    """The first leaf of a group."""
    error = group.exceptions[0]
    return first_of(error) if isinstance(error, BaseExceptionGroup) else error
