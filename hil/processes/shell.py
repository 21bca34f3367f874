"""What the processes have in common: how they are told to end, and how they say why they did.

By hand they run until Ctrl-C and speak on standard error; under a supervisor they speak
through their lifeline.
"""

import asyncio
import logging
import os
import selectors
import signal
from collections.abc import Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any, Self

from bus.address import open_transport
from bus.mistake import Mistake
from bus.transport import BusClosed, BusUnavailable, Transport
from hil.ending import Ending
from hil.host import Sleeps
from hil.lifeline import Lifeline, SupervisorGone


def ending_of(body: Callable[[Lifeline], Ending]) -> Ending:
    """Run a body; what the bus or the supervisor did to it becomes one line and an exit code."""
    line = Lifeline.from_environment()
    try:
        return body(line)
    except BusUnavailable as error:
        line.error(str(error))
    except BusClosed as error:
        line.error(f"lost the bus: {error}")
    except SupervisorGone as error:
        line.error(str(error))
        return Ending.PEER_DIED
    except Mistake as error:
        line.error(str(error))
        return Ending.MISUSED
    return Ending.HUB_LOST


def reach(address: str) -> None:
    """Open a bus and leave it: what is missing is told now, and not after a minute of compiling."""
    open_transport(address).close()


def log_to(file: Path | None) -> None:
    """Findings into `file`, or onto standard error."""
    logging.basicConfig(
        filename=file, level=logging.INFO, format="%(asctime)s %(name)s %(levelname)s %(message)s", force=True
    )


def run_until_signal(work: Coroutine[Any, Any, None], sleeps: Sleeps | None = None) -> bool:
    """Run `work`; SIGTERM and Ctrl-C cancel it. Whether that happened. sleeps: the selector of its event loop."""

    async def guarded() -> bool:
        task = asyncio.ensure_future(work)
        for number in (signal.SIGINT, signal.SIGTERM):
            asyncio.get_running_loop().add_signal_handler(number, task.cancel)
        try:
            await task
        except asyncio.CancelledError:
            return True
        return False

    with asyncio.Runner(loop_factory=lambda: asyncio.SelectorEventLoop(sleeps)) as runner:
        return runner.run(guarded())


class Stop:
    """SIGTERM and Ctrl-C as a file descriptor, for a loop that waits on a bus."""

    def __init__(self) -> None:
        self._reader, self._writer = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)

    def __enter__(self) -> Self:
        self._before = {
            number: signal.signal(number, lambda *_: None) for number in (signal.SIGINT, signal.SIGTERM)
        }
        self._wakeup = signal.set_wakeup_fd(self._writer)
        return self

    def __exit__(self, *_: object) -> None:
        signal.set_wakeup_fd(self._wakeup)
        for number, handler in self._before.items():
            signal.signal(number, handler)
        os.close(self._reader)
        os.close(self._writer)

    def fileno(self) -> int:
        """Readable once the signal has come."""
        return self._reader

    def readable(self, *descriptors: int) -> Iterator[None]:
        """Yield whenever one of `descriptors` is readable, and once more after the signal."""
        with selectors.DefaultSelector() as selector:
            for descriptor in descriptors:
                selector.register(descriptor, selectors.EVENT_READ)
            selector.register(self._reader, selectors.EVENT_READ)
            while True:
                ready = {key.fd for key, _ in selector.select()}
                yield
                if self._reader in ready:
                    return


def counters(bus: Transport) -> dict[str, int]:
    """Frames of a transport, as figures of the process."""
    counts = bus.statistics()
    return {
        "sent": counts.sent,
        "received": counts.received,
        "dropped": counts.dropped_in + counts.dropped_out,
    }
