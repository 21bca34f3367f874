"""Shared by all processes of the bench: how signals end them, and how they report their end.

Started by hand they run until Ctrl-C and report on standard error; under a supervisor they report
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
from bus.transport import BusClosed, BusUnavailable, Transport
from bus.user_error import UserError
from hil.ending import STORAGE, Ending, ending_of_error
from hil.shell.lifeline import Lifeline, SupervisorGone
from hil.timing.host import Sleeps


def ending_of(body: Callable[[Lifeline], Ending]) -> Ending:
    """Run a body; losing the bus or the supervisor, and errors of the user, become one line and an exit code."""
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
    except UserError as error:
        line.error(str(error))
        return ending_of_error(error)
    except OSError as error:
        if error.errno not in STORAGE:
            raise
        where = f"{error.filename}: " if error.filename is not None else ""
        line.error(f"{where}{error.strerror}; what was being written is incomplete")
        return Ending.FAILED
    return Ending.HUB_LOST


def reach(address: str) -> None:
    """Open a bus and close it again, so that a missing bus is an error at once and not after a minute of compiling."""
    open_transport(address).close()


def log_to(file: Path | None) -> None:
    """Log findings into `file`, whose folder is made if it is missing, or onto standard error."""
    if file is not None:
        file.parent.mkdir(parents=True, exist_ok=True)
    logging.basicConfig(
        filename=file, level=logging.INFO, format="%(asctime)s %(name)s %(levelname)s %(message)s", force=True
    )


def run_until_signal(work: Coroutine[Any, Any, None], sleeps: Sleeps | None = None) -> bool:
    """Run `work`; SIGTERM and Ctrl-C cancel it. Whether that happened. sleeps: the selector of its event loop."""

    async def guarded() -> bool:
        task = asyncio.ensure_future(work)
        for number in (signal.SIGINT, signal.SIGTERM):
            # cancelling, not raising KeyboardInterrupt: `finally` blocks of the task then run in order
            asyncio.get_running_loop().add_signal_handler(number, task.cancel)
        try:
            await task
        except asyncio.CancelledError:
            return True
        finally:
            # A loop that closes ends this pipe before it removes the handlers: a signal in between would be reported as a
            # write that failed.
            signal.set_wakeup_fd(-1)
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
        # a pipe instead of a handler: the loop waits in poll, which returns at once also if the signal came just before
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
                # once more after the signal, so that frames that arrived before it are still handled
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
