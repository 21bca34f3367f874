"""The modelled wire, on virtual time."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus.arbitration import Arbiter, priority
from bus.bits import classic_bits, duration_ns
from bus.frame import ERROR, EXTENDED, REMOTE, Frame
from tests.bus.laws import classic, remote

RATE = 500_000
offers = st.lists(st.tuples(st.integers(0, 3), classic, st.integers(0, 600_000)), max_size=30)


def carried(schedule: list[tuple[int, Frame, int]]) -> list[tuple[int, Frame]]:
    """(station, frame) as they arrive; schedule: (station, frame, time since the last offer [ns])."""
    arbiter: Arbiter[int] = Arbiter(RATE)
    now, arrived = 0, []
    for station, frame, later in schedule:
        now += later
        arrived += arbiter.offer(station, frame, now)
    while arbiter.due_ns is not None:
        arrived += arbiter.advance(arbiter.due_ns)
    return arrived


@given(classic | remote, classic | remote)
def test_priority_is_the_order_of_the_bits_on_the_wire(one: Frame, other: Frame) -> None:
    """Wired AND: at the first bit that differs, the dominant 0 wins; reference: the bits themselves."""
    if priority(one.can_id) != priority(other.can_id):
        bits_one, bits_other = classic_bits(one), classic_bits(other)
        assert (priority(one.can_id) < priority(other.can_id)) == (bits_one < bits_other)


def test_an_error_flag_comes_before_everything() -> None:
    assert priority(ERROR | 0x7FF) < priority(0)


def test_kinds_of_frame_with_equal_base_identifiers() -> None:
    base = 0x123
    ordered = [
        base,
        base | REMOTE,
        EXTENDED | base << 18,
        EXTENDED | REMOTE | base << 18,
        EXTENDED | base << 18 | 1,
    ]
    assert all(priority(first) < priority(later) for first, later in itertools.pairwise(ordered))


@given(offers)
def test_every_frame_arrives_once_and_each_station_keeps_its_order(schedule) -> None:
    arrived = carried(schedule)
    for station in range(4):
        sent = [frame for who, frame, _ in schedule if who == station]
        assert [frame._replace(at_ns=0) for who, frame in arrived if who == station] == sent


@given(offers)
def test_the_wire_carries_one_frame_at_a_time_and_is_never_idle_while_one_waits(schedule) -> None:
    arrived = carried(schedule)
    starts = [frame.at_ns - duration_ns(frame, RATE) for _, frame in arrived]
    ends = [frame.at_ns for _, frame in arrived]
    offered = list(itertools.accumulate(later for _, _, later in schedule))
    for end, start in zip(ends, starts[1:], strict=False):
        assert start >= end
        if start > end:  # a gap begins when all offered so far have arrived, and ends with an offer
            assert sum(time <= end for time in offered) <= sum(other <= end for other in ends)
            assert start in offered


@given(offers)
def test_no_frame_starts_while_a_better_one_waits_at_the_head_of_another_queue(schedule) -> None:
    arrived = carried(schedule)
    times = list(itertools.accumulate(later for _, _, later in schedule))
    queues = {
        who: [(t, f) for (w, f, _), t in zip(schedule, times, strict=True) if w == who] for who in range(4)
    }
    for who, frame in arrived:
        start = frame.at_ns - duration_ns(frame, RATE)
        queues[who].pop(0)
        for other, queue in queues.items():
            if other != who and queue and queue[0][0] < start:
                assert priority(frame.can_id) <= priority(queue[0][1].can_id)


@given(offers)
def test_busy_time_is_the_sum_of_all_frames(schedule) -> None:
    arbiter: Arbiter[int] = Arbiter(RATE)
    for station, frame, _ in schedule:
        arbiter.offer(station, frame, 0)
    while arbiter.due_ns is not None:
        arbiter.advance(arbiter.due_ns)
    assert arbiter.busy_ns == sum(duration_ns(frame, RATE) for _, frame, _ in schedule)


@pytest.mark.parametrize("rate", [0, -1, 4_999, 20_000_001])
def test_impossible_bit_rates_are_refused(rate: int) -> None:
    with pytest.raises(ValueError, match=f"bit_rate={rate} bit/s is outside 5000 to 20000000"):
        Arbiter(rate)
