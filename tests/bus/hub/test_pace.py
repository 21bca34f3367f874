"""The hub under load: backlog, a bit rate as on a real bus, priority, stamps."""

import itertools
import time
from types import SimpleNamespace

import pytest

from bus.bits import duration_ns
from bus.frame import Frame
from bus.hub.client import hub_status
from bus.hub.peer import BACKLOG_LIMIT
from bus.hub.server import WAITING_LIMIT
from tests.bus.hub.running import RunningHub
from tests.bus.laws import collect, numbered, unstamped


def test_what_a_slow_client_can_lose_is_bounded_by_its_backlog(hub: RunningHub) -> None:
    """A pause of a second at full load of several buses loses nothing, whatever the kernel's limits are."""
    with hub.connect() as sender, hub.connect() as sleeper, hub.connect() as reader:
        for _ in range(BACKLOG_LIMIT // 64):
            for frame in numbered(64):
                assert sender.send(frame)
            collect(reader, 64)
        assert unstamped(collect(sleeper, BACKLOG_LIMIT)) == numbered(64) * (BACKLOG_LIMIT // 64)


def test_a_bit_rate_makes_the_hub_as_slow_as_a_bus_with_the_lowest_identifier_first(path: str) -> None:
    """Ends of frames are at least their own length apart, and what waits is sent by priority."""
    running, carried_s = RunningHub(path, bit_rate=20_000), 0.0
    try:
        with running.connect() as low, running.connect() as high, running.connect() as receiver:
            sent_in_time = False
            while not sent_in_time:  # else this thread was held up until the wire was free again
                before_ns = time.monotonic_ns()
                for index in range(10):
                    low.send(Frame(0x700, bytes([index] * 8)))
                high.send(Frame(0x010, b"urgent"))
                sent_in_time = time.monotonic_ns() - before_ns < 5 * duration_ns(
                    Frame(0x700, bytes(8)), 20_000
                )
                frames = collect(receiver, 11)
                carried_s += sum(duration_ns(frame, 20_000) for frame in frames) * 1e-9
            for earlier, later in itertools.pairwise(frames):
                assert later.at_ns - earlier.at_ns >= duration_ns(later, 20_000)
            assert [frame.data[0] for frame in frames if frame.can_id == 0x700] == list(range(10))
            assert frames[-1].can_id == 0x700  # the urgent frame came last and was not carried last
            status = hub_status(path)
            assert status.bit_rate == 20_000
            assert status.busy_s == pytest.approx(carried_s)
    finally:
        running.stop()


def test_a_client_that_floods_a_slow_bus_is_held_back_and_loses_nothing(path: str) -> None:
    """More than the hub queues for one client waits in its socket; it may even leave meanwhile."""
    running = RunningHub(path, bit_rate=1_000_000)
    try:
        with running.connect() as receiver:
            with running.connect() as flood:
                for frame in numbered(500):
                    assert flood.send(frame)
            assert unstamped(collect(receiver, 500)) == numbered(500)
    finally:
        running.stop()


def test_the_hub_stops_reading_from_a_client_whose_frames_wait_for_the_wire(path: str) -> None:
    running = RunningHub(path, bit_rate=5_000)
    try:
        with running.connect() as flood:
            for frame in numbered(10 * WAITING_LIMIT):
                assert flood.send(frame)
            waiting = [hub_status(path).clients[0].waiting for _ in range(50)]
            assert max(waiting) == WAITING_LIMIT
    finally:
        running.stop()


def test_stamps_strictly_increase_even_when_the_clock_does_not(
    path: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bus.hub.server.time", SimpleNamespace(monotonic_ns=lambda: 1_000))
    running = RunningHub(path)
    try:
        with running.connect() as sender, running.connect() as receiver:
            for frame in numbered(3):
                sender.send(frame)
            assert [frame.at_ns for frame in collect(receiver, 3)] == [1_001, 1_002, 1_003]
    finally:
        running.stop()
