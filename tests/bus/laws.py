"""What every transport keeps to, whatever carries its frames; each kind of bus runs all of it."""

import os
import select
import time
from typing import Protocol

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bus.errors import Fault
from bus.frame import BRS, ERROR, ESI, EXTENDED, FD, REMOTE, Frame
from bus.hub.packet import FD_LENGTHS
from bus.transport import BusClosed, Transport

WAIT_S = 60.0
"""Far beyond what any bus needs, or a program to start on a busy machine: a test that waits this long has failed."""


class Bench(Protocol):
    """A bus under test; slack_ns: how far its stamps may be off the clock."""

    slack_ns: int

    def connect(self) -> Transport: ...


def readable(transport: Transport, timeout_s: float = 0.0) -> bool:
    """Whether the descriptor is readable within the time."""
    poll = select.poll()
    poll.register(transport.fileno(), select.POLLIN)
    return bool(poll.poll(timeout_s * 1e3))


def collect(transport: Transport, count: int) -> list[Frame]:
    """Wait for `count` frames; a test failure if they do not come."""
    frames: list[Frame] = []
    while len(frames) < count:
        assert readable(transport, WAIT_S), f"{len(frames)} of {count} frames came"
        frames += transport.drain(count - len(frames))
    return frames


def unstamped(frames: list[Frame]) -> list[Frame]:
    """The frames without their stamps."""
    return [frame._replace(at_ns=0) for frame in frames]


def numbered(count: int, sender: int = 0) -> list[Frame]:
    """Frames that all differ."""
    return [Frame(0x100 + sender, index.to_bytes(4, "big")) for index in range(count)]


identifiers = st.integers(0, 0x7FF) | st.integers(0, 0x1FFF_FFFF).map(lambda value: value | EXTENDED)
classic = st.tuples(identifiers, st.binary(max_size=8)).map(lambda parts: Frame(*parts))
remote = st.tuples(identifiers, st.integers(0, 8)).map(
    lambda parts: Frame(parts[0] | REMOTE, bytes(parts[1]))
)
fd_data = st.sampled_from(sorted(FD_LENGTHS)).flatmap(lambda size: st.binary(min_size=size, max_size=size))
fd_flags = st.sampled_from([FD, FD | BRS, FD | ESI, FD | BRS | ESI])
fd = st.tuples(identifiers, fd_data, st.just(0), fd_flags).map(lambda parts: Frame(*parts))


class TransportLaws:
    """Subclass it and provide the fixture `bench`."""

    def test_a_frame_arrives_unchanged_everywhere_but_at_its_sender(self, bench: Bench):
        with bench.connect() as sender, bench.connect() as one, bench.connect() as other:

            @given(frame=classic | remote | fd)
            @settings(deadline=None, max_examples=100)
            def law(frame: Frame) -> None:
                before = time.monotonic_ns()
                assert sender.send(frame)
                received = collect(one, 1) + collect(other, 1)
                after = time.monotonic_ns()
                assert unstamped(received) == [frame, frame]
                assert received[0].at_ns == received[1].at_ns
                assert before - bench.slack_ns <= received[0].at_ns <= after + bench.slack_ns
                assert sender.drain() == []

            law()

    def test_all_receivers_agree_on_order_and_time(self, bench: Bench):
        with bench.connect() as a, bench.connect() as b, bench.connect() as one, bench.connect() as other:
            for from_a, from_b in zip(numbered(100, 1), numbered(100, 2), strict=True):
                assert a.send(from_a)
                assert b.send(from_b)
            seen = collect(one, 200)
            assert collect(other, 200) == seen
            assert [frame for frame in unstamped(seen) if frame.can_id == 0x101] == numbered(100, 1)
            assert [frame for frame in unstamped(seen) if frame.can_id == 0x102] == numbered(100, 2)
            stamps = [frame.at_ns for frame in seen]
            assert stamps == sorted(stamps)
            assert unstamped(collect(b, 100)) == numbered(100, 1)

    def test_the_descriptor_is_readable_exactly_while_frames_wait(self, bench: Bench):
        with bench.connect() as sender, bench.connect() as receiver:
            assert not readable(receiver)
            assert receiver.drain() == []
            for frame in numbered(5):
                sender.send(frame)
            got = collect(receiver, 4)
            assert readable(receiver, WAIT_S)
            got += receiver.drain()
            assert unstamped(got) == numbered(5)
            assert not readable(receiver)
            assert receiver.drain() == []

    def test_drain_keeps_its_limit(self, bench: Bench):
        with bench.connect() as sender, bench.connect() as receiver, bench.connect() as witness:
            for frame in numbered(150):
                assert sender.send(frame)
            collect(witness, 150)
            assert [len(receiver.drain()), len(receiver.drain(7)), len(receiver.drain(100))] == [64, 7, 79]

    def test_who_joins_later_hears_nothing_from_before(self, bench: Bench):
        with bench.connect() as sender, bench.connect() as witness:
            sender.send(Frame(1, b"early"))
            collect(witness, 1)
            with bench.connect() as late:
                sender.send(Frame(2, b"late"))
                assert unstamped(collect(late, 1)) == [Frame(2, b"late")]

    def test_statistics_count_every_frame(self, bench: Bench):
        with bench.connect() as sender, bench.connect() as receiver:
            for frame in numbered(10):
                sender.send(frame)
            collect(receiver, 10)
            assert (sender.statistics().sent, sender.statistics().received) == (10, 0)
            assert (receiver.statistics().sent, receiver.statistics().received) == (0, 10)
            assert receiver.statistics().dropped_in == sender.statistics().dropped_out == 0

    def test_a_receiver_that_does_not_read_loses_frames_alone_and_counts_them(self, bench: Bench):
        """The sender is never blocked, the reader beside it loses nothing, and nothing is lost unseen."""
        with bench.connect() as sender, bench.connect() as reader, bench.connect() as sleeper:
            sent = read = 0
            while sent < 120_000 and sleeper.statistics().dropped_in == 0:
                for frame in numbered(50):
                    assert sender.send(frame)
                sent += 50
                read += len(collect(reader, 50))
                if sent >= 40_000:  # the drop count travels with a frame: look, slowly, from time to time
                    sleeper.drain(1)
            late = sleeper.statistics().received
            sender.send(Frame(0x7FF, b"last"))
            collect(reader, 1)
            while readable(sleeper, 0.5):
                sleeper.drain()
            sender.send(Frame(0x7FF, b"mark"))
            while collect(sleeper, 1)[-1].data != b"mark":
                pass  # the bus stood still for a while and had more
            assert late < sent
            seen = sleeper.statistics()
            assert seen.dropped_in > 0
            assert seen.received + seen.dropped_in == sent + 2
            assert reader.statistics().dropped_in == 0
            assert read == sent

    def test_error_frames_come_as_frames_and_in_words(self, bench: Bench):
        with bench.connect() as sender, bench.connect() as receiver:
            frames = [Frame(ERROR | 0x044, b"\0\x20\0\0\0\0\x80\0"), Frame(1, b"data")]
            for frame in frames:
                sender.send(frame)
            received = collect(receiver, 2)
            assert unstamped(received) == frames
            found = receiver.findings()
            assert [finding.fault for finding in found] == [Fault.BUS_OFF, Fault.PASSIVE]
            assert {finding.at_ns for finding in found} == {received[0].at_ns}
            assert receiver.findings() == []
            assert receiver.statistics().errors == 1
            assert receiver.send(frames[1])  # a frame said bus off, not the controller: it can still send

    def test_closing_ends_one_connection_and_no_other(self, bench: Bench):
        with bench.connect() as sender, bench.connect() as receiver:
            leaver = bench.connect()
            descriptor = leaver.fileno()
            leaver.close()
            leaver.close()
            with pytest.raises(OSError, match="Bad file descriptor"):
                os.fstat(descriptor)
            with pytest.raises(BusClosed):
                leaver.send(Frame(1, b""))
            with pytest.raises(BusClosed):
                leaver.drain()
            assert sender.send(Frame(1, b"still here"[:8]))
            assert len(collect(receiver, 1)) == 1

    @pytest.mark.parametrize(
        ("frame", "says"),
        [
            (Frame(0x123, bytes(9)), "frame 123: 9 data bytes; a classic frame carries 0 to 8"),
            (Frame(EXTENDED | 0x123, bytes(65), 0, FD), "frame 123: 65 data bytes; CAN FD carries"),
            (Frame(0x123, bytes(9), 0, FD), "frame 123: 9 data bytes; CAN FD carries"),
        ],
    )
    def test_data_that_fit_no_frame_are_refused(self, bench: Bench, frame: Frame, says: str):
        with bench.connect() as sender, pytest.raises(ValueError, match=says):
            sender.send(frame)
