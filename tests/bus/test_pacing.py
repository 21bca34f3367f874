"""Waiting for descriptors: nothing is missed, errors arrive where they are awaited, nothing stays registered."""

import asyncio
import os
from collections.abc import Iterator

import pytest

from bus.pacing import readable, reading


@pytest.fixture
def counter() -> Iterator[int]:
    """A descriptor that is readable while its count is not zero."""
    descriptor = os.eventfd(0, os.EFD_NONBLOCK)
    yield descriptor
    os.close(descriptor)


def registered(fd: int) -> bool:
    """Whether the loop still watches `fd`; asking ends it."""
    return asyncio.get_running_loop().remove_reader(fd)


def test_every_arrival_is_read_until_the_task_is_cancelled(counter: int) -> None:
    async def run() -> list[int]:
        seen: list[int] = []
        arrived = asyncio.Event()

        def read() -> None:
            seen.append(os.eventfd_read(counter))
            arrived.set()

        task = asyncio.create_task(reading(counter, read))
        for number in (1, 2, 3):
            os.eventfd_write(counter, number)
            await arrived.wait()
            arrived.clear()
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert not registered(counter)
        return seen

    assert asyncio.run(run()) == [1, 2, 3]


def test_what_read_raises_is_raised_to_who_waits_and_read_is_not_called_again(counter: int) -> None:
    calls = []

    def read() -> None:
        calls.append(1)
        raise ConnectionError("the bus is gone")

    async def run() -> None:
        os.eventfd_write(counter, 1)
        with pytest.raises(ConnectionError, match="the bus is gone"):
            await reading(counter, read)
        assert not registered(counter)
        await asyncio.sleep(0)

    asyncio.run(run())
    assert calls == [1]


def test_waiting_once_leaves_nothing_registered(counter: int) -> None:
    async def run() -> None:
        os.eventfd_write(counter, 1)
        await readable(counter)
        assert not registered(counter)

    asyncio.run(run())
