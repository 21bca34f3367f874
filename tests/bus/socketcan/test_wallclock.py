"""The difference between the wall clock and the monotonic one."""

import itertools
import time
from types import SimpleNamespace

import pytest

from bus.socketcan.wallclock import WallClock


def test_a_wall_time_becomes_the_monotonic_time_of_the_same_moment() -> None:
    clock = WallClock()
    before = time.monotonic_ns()
    wall = time.time_ns()
    after = time.monotonic_ns()
    slack_ns = 100_000  # how well the difference is known; about 100 ns on a quiet machine
    assert before - slack_ns <= clock.monotonic_ns(wall) <= after + slack_ns


def test_a_set_clock_is_noticed_and_slewing_is_not() -> None:
    clock = WallClock()
    true = clock.ahead_ns
    clock.ahead_ns = true + 500_000
    started_ns = time.monotonic_ns()
    assert not clock.set_since(started_ns)
    assert clock.ahead_ns == true + 500_000
    clock.ahead_ns = true + 3_600_000_000_000
    assert clock.set_since(started_ns)
    assert abs(clock.ahead_ns - true) < 1_000_000
    assert not clock.set_since(time.monotonic_ns() + 2_000_000_000)


def test_an_interruption_between_the_two_readings_is_not_taken_for_a_set_clock(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Stamps of two buses would otherwise disagree by what two measurements differ."""
    clock = WallClock()
    true = clock.ahead_ns
    late = itertools.chain([time.time_ns() - 10_000_000], iter(time.time_ns, None))
    real = SimpleNamespace(time_ns=lambda: next(late), monotonic_ns=time.monotonic_ns)
    monkeypatch.setattr("bus.socketcan.wallclock.time", real)
    clock.check()
    assert clock.ahead_ns == true
