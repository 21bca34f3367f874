"""The bench without asyncio: every call returns when it is done."""

import asyncio
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from types import TracebackType
from typing import Self

from bus.frame import Frame
from testbench.api.bench import Bench, Moment


def blocking(bench: Bench) -> "BlockingBench":
    """`with blocking(Bench.lockstep("loaded")) as bench:`"""
    return BlockingBench(bench)


class BlockingBench(AbstractContextManager["BlockingBench"]):
    """The methods of `Bench`; see there. Not for use inside an event loop."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        # one loop for all calls: the bench's tasks and events belong to the loop in which they were made
        self._runner = asyncio.Runner()

    def __enter__(self) -> Self:
        try:
            self._runner.run(self._bench.__aenter__())
        except BaseException:
            self._runner.close()  # nobody leaves what could not be entered
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._runner.run(self._bench.__aexit__(kind, error, trace))
        finally:
            self._runner.close()

    @property
    def now_s(self) -> float:
        """Time on the bench's clock [s]."""
        return self._bench.now_s

    @property
    def frames(self) -> Sequence[Frame]:
        """Everything that was on the bus so far."""
        return self._bench.frames

    def keep(self, folder: Path) -> Path:
        """As `Bench.keep`."""
        return self._bench.keep(folder)

    def value(self, name: str) -> float:
        """As `Bench.value`."""
        return self._bench.value(name)

    def run_for(self, seconds: float) -> None:
        """As `Bench.run_for`."""
        self._runner.run(self._bench.run_for(seconds))

    step = run_for

    def stimulate(self, name: str, value: float | str) -> None:
        """As `Bench.stimulate`."""
        self._runner.run(self._bench.stimulate(name, value))

    def inject(self, **fault: object) -> str:
        """As `Bench.inject`."""
        return self._runner.run(self._bench.inject(**fault))

    def clear(self) -> None:
        """As `Bench.clear`."""
        self._runner.run(self._bench.clear())

    def wait_for(self, condition: str, *, within_s: float) -> Moment:
        """As `Bench.wait_for`."""
        return self._runner.run(self._bench.wait_for(condition, within_s=within_s))

    def expect(self, condition: str, *, within_s: float) -> Moment:
        """As `Bench.expect`."""
        return self._runner.run(self._bench.expect(condition, within_s=within_s))

    def holds(self, condition: str, *, for_s: float) -> None:
        """As `Bench.holds`."""
        self._runner.run(self._bench.holds(condition, for_s=for_s))
