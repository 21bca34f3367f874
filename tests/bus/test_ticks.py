"""Laws of the absolute timer, bracketed by clock readings: they hold on a machine of any speed."""

import os
import select
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bus.ticks import Ticks

MS = 1_000_000
S = 1_000 * MS


def due_by(now_ns: int, start_ns: int, period_ns: int) -> int:
    """How many ticks are due at `now_ns`: the definition."""
    return max(0, (now_ns - start_ns) // period_ns + 1)


@given(period_ns=st.integers(50_000, 10 * S), late_ns=st.integers(0, 5 * S))
@settings(deadline=None, max_examples=50)
def test_a_start_in_the_past_counts_every_tick_since(period_ns: int, late_ns: int) -> None:
    before = time.monotonic_ns()
    start = before - late_ns
    with Ticks(period_ns, start) as ticks:
        count = ticks.expired()
        after = time.monotonic_ns()
        assert due_by(before, start, period_ns) <= count <= due_by(after, start, period_ns)
        assert ticks.due_ns == start + (count - 1) * period_ns


def test_no_tick_is_lost_or_invented_however_irregularly_one_looks() -> None:
    period, start = 300_000, time.monotonic_ns() + MS
    total = 0
    with Ticks(period, start) as ticks:
        for pause in range(40):
            before = time.monotonic_ns()
            total += ticks.expired()
            after = time.monotonic_ns()
            assert due_by(before, start, period) <= total <= due_by(after, start, period)
            assert ticks.due_ns == start + (total - 1) * period
            until = after + pause * 50_000
            while time.monotonic_ns() < until:
                pass
    assert total > 0


def test_the_descriptor_is_readable_exactly_while_a_tick_is_due() -> None:
    with Ticks(3600 * S, time.monotonic_ns() + 20 * MS) as ticks:
        assert ticks.expired() == 0
        poll = select.poll()
        poll.register(ticks.fileno(), select.POLLIN)
        assert poll.poll(10_000)
        assert time.monotonic_ns() >= ticks.due_ns + ticks.period_ns  # never early
        assert ticks.expired() == 1
        assert not poll.poll(0)
        assert ticks.expired() == 0


def test_the_first_tick_is_one_period_away_by_default() -> None:
    before = time.monotonic_ns()
    with Ticks(5 * MS) as ticks:
        after = time.monotonic_ns()
        assert before <= ticks.due_ns <= after
        select.select([ticks.fileno()], [], [], 10)
        count = ticks.expired()
        assert count >= 1
        assert before + count * 5 * MS <= ticks.due_ns <= after + count * 5 * MS


def test_close_releases_the_descriptor_and_may_be_repeated() -> None:
    ticks = Ticks(S)
    fd = ticks.fileno()
    ticks.close()
    ticks.close()
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(fd)


@pytest.mark.parametrize(
    ("period_ns", "start_ns", "name"), [(0, 1, "period_ns=0"), (-5, 1, "period_ns=-5"), (1, 0, "start_ns=0")]
)
def test_impossible_schedules_are_refused(period_ns: int, start_ns: int, name: str) -> None:
    with pytest.raises(ValueError, match=name):
        Ticks(period_ns, start_ns)
