"""What every process that ticks on a bus needs: waiting for a descriptor, and its own timing kept."""

import asyncio
from array import array
from collections.abc import Callable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Error = TypeVar("Error", bound=BaseException)


class TickTiming:
    """Per tick: how late it started and how long it took, integer nanoseconds; and the ticks missed."""

    def __init__(self) -> None:
        self._lateness = array("q")
        self._execution = array("q")
        self.missed = 0

    def add(self, lateness_ns: int, execution_ns: int) -> None:
        """One tick."""
        self._lateness.append(lateness_ns)
        self._execution.append(execution_ns)

    def arrays(self) -> dict[str, NDArray[np.int64]]:
        """Columns for timing.npz."""
        return {
            "lateness_ns": np.array(self._lateness, dtype=np.int64),
            "execution_ns": np.array(self._execution, dtype=np.int64),
            "missed": np.array(self.missed, dtype=np.int64),
        }


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
