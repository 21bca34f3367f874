"""Keywords for Robot Framework: `Library    testbench.robot_library.BenchLibrary`.

Needs nothing of Robot Framework itself: it reads keywords, scope and listener from the class. docs/howto/test-in-robot.md
"""

import re
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any, TypeVar

from testbench.api import Bench, BlockingBench, blocking
from testbench.api.driven import NotPossible

T = TypeVar("T")


class BenchLibrary:
    """The methods of `testbench.api.Bench` as keywords. Times are Robot's: `50 ms`, `1.5 s`.

    A bench that a test starts ends with the test, one of a suite's set-up with the suite. The recording of a test that fails is kept.
    """

    ROBOT_LIBRARY_SCOPE = "SUITE"
    ROBOT_LISTENER_API_VERSION = 3

    def __init__(
        self, realtime: bool = False, ecu: str | None = None, recordings: Path = Path("out/robot")
    ) -> None:
        """realtime: processes instead of lockstep; ecu: bus of a real ECU, which implies it; recordings: of tests that failed."""
        self.ROBOT_LIBRARY_LISTENER = self
        self._realtime, self._ecu, self._recordings = realtime or ecu is not None, ecu, recordings
        self._bench: BlockingBench | None = None
        self._in_test = self._of_test = False

    def start_bench(self, scenario: str = "standstill", **choice: Any) -> None:
        """Start the scenario. Choices are fields of `hil.compose.Choice`: `limits=${False}`, `seed=${3}`."""
        made = (
            Bench.realtime(scenario, ecu=self._ecu, **choice)
            if self._realtime
            else Bench.lockstep(scenario, **choice)
        )
        self._start(made)

    def start_rest_bus(
        self, bus: str, *simulate: str, dbc: Path | None = None, values: Path | None = None
    ) -> None:
        """Simulate nodes of a DBC around a real controller on a bus, without a plant."""
        nodes = simulate or ("Machine",)
        given = {"dbc": dbc} if dbc is not None else {}
        self._start(Bench.on_bus(bus, simulate=nodes, values=values, **given))

    def stop_bench(self) -> None:
        """End the bench; without one, nothing."""
        if self._bench is not None:
            self._bench.__exit__(None, None, None)
            self._bench = None

    def run_for(self, time: timedelta) -> None:
        """Let time pass on the bench's clock."""
        self._running.run_for(time.total_seconds())

    def wait_for(self, condition: str, within: timedelta) -> float:
        """The first moment [s] at which `Message.Signal OPERATOR VALUE` holds."""
        return self._running.wait_for(condition, within_s=within.total_seconds()).time_s

    def expect(self, condition: str, within: timedelta) -> float:
        """The same as an assertion: the test fails where the condition does not hold in time."""
        return self._running.expect(condition, within_s=within.total_seconds()).time_s

    def holds(self, condition: str, during: timedelta) -> None:
        """The condition holds in every sample that comes."""
        self._running.holds(condition, for_s=during.total_seconds())

    def value_of(self, signal: str) -> float:
        """The newest value of a signal."""
        return self._running.value(signal)

    def stimulate(self, signal: str, value: float | str) -> None:
        """Receivers get this value from now on, with a right CRC."""
        self._running.stimulate(signal, value)

    def inject(self, kind: str, **fault: Any) -> str:
        """A fault by the keys of a [[fault]] table; `at_s` counts from now."""
        return self._running.inject(kind=kind, **{key: _number(value) for key, value in fault.items()})

    def clear_faults(self) -> None:
        """End every stimulus and fault."""
        self._running.clear()

    def bench_time(self) -> float:
        """Time on the bench's clock [s]."""
        return self._running.now_s

    def frames_seen(self) -> int:
        """Number of frames that were on the bus so far."""
        return len(self._running.frames)

    @property
    def _running(self) -> BlockingBench:
        if self._bench is None:
            raise NotPossible("no bench runs: begin the test with `Start Bench` or `Start Rest Bus`")
        return self._bench

    def _start(self, bench: Bench) -> None:
        self.stop_bench()
        self._bench, self._of_test = blocking(bench).__enter__(), self._in_test

    # the listener's methods: an underscore keeps them from being keywords, and Robot Framework looks for these names

    def _start_test(self, data: Any, result: Any) -> None:
        self._in_test = True

    def _end_test(self, data: Any, result: Any) -> None:
        self._in_test, bench = False, self._bench
        if bench is None:
            return
        if self._of_test:
            self.stop_bench()
        if result.failed:
            self._attach(bench, result)

    def _end_suite(self, data: Any, result: Any) -> None:
        self.stop_bench()

    def _attach(self, bench: BlockingBench, result: Any) -> None:
        """Keep a recording and name it in the message of the test."""
        # file names are limited to 255 bytes; the end of a full name holds the test
        folder = self._recordings / re.sub(r"[^\w.-]+", "_", result.full_name)[-120:]
        try:
            bench.keep(folder)
        except (OSError, ValueError) as error:  # a full disk must not hide why the test failed
            result.message += f"\nloaderhil: the recording could not be kept: {error}"
            return
        result.message += f"\nloaderhil recording: {folder} (loaderhil report {folder})"


def _number(value: Any) -> Any:
    """Robot Framework hands on texts; a fault's table has numbers and flags."""
    readers: tuple[Callable[[str], Any], ...] = (int, float, {"true": True, "false": False}.__getitem__)
    if not isinstance(value, str):
        return value
    for read in readers:
        try:
            return read(value.lower())
        except (ValueError, KeyError):
            continue
    return value
