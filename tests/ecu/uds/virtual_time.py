"""can-isotp's timers by a test's clock: pauses and timeouts of transfers then take no time and are the same in every run."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from unittest import mock

import isotp.tools


@contextmanager
def virtual_timers(now_ns: Callable[[], int]) -> Iterator[None]:
    """Links that are made within go by this clock."""

    class Timer(isotp.tools.Timer):
        def start(self, timeout: float | None = None) -> None:
            if timeout is not None:
                self.set_timeout(timeout)
            self.start_time = now_ns()

        def elapsed_ns(self) -> int:
            return 0 if self.start_time is None else now_ns() - self.start_time

    with mock.patch("isotp.protocol.Timer", Timer):
        yield
