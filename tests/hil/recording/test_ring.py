"""The ring: first in, first out, never waiting; what finds no room is counted."""

import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bus.frame import FD, Frame
from hil.recording.ring import RECORD, Ring, frames_of, records_of
from tests.bus.laws import classic, fd, remote


@pytest.fixture
def ring():
    made = Ring.create(slots=16)
    yield made
    made.close()


@given(st.lists(classic | remote | fd, max_size=8), st.integers(0, 255))
def test_a_record_is_the_frame(frames, channel):
    assert frames_of(records_of(frames, channel)) == [(channel, frame) for frame in frames]


@given(st.lists(st.tuples(st.booleans(), st.integers(0, 20)), max_size=40))
@settings(deadline=None)
def test_what_is_taken_is_what_was_put_in_order(turns):
    """A queue of 16 that drops the newest, as a list does it; head and tail go round many times."""
    with_ring, queue, number, dropped = Ring.create(slots=16), [], 0, 0
    other = Ring.attach(os.dup(with_ring.fileno()))
    try:
        for putting, count in turns:
            if putting:
                frames = [
                    Frame(number + k, (number + k).to_bytes(8, "big"), number + k) for k in range(count)
                ]
                number += count
                with_ring.put(frames, 3)
                room = 16 - len(queue)
                queue += frames[:room]
                dropped += max(count - room, 0)
            else:
                taken = frames_of(other.take(count))
                assert taken == [(3, frame) for frame in queue[:count]]
                del queue[:count]
            assert other.dropped == dropped
        assert other.put_count == number - dropped
    finally:
        with_ring.close()
        other.close()


def test_what_was_taken_is_a_copy(ring):
    ring.put([Frame(1, b"\x01")], 0)
    taken = ring.take(4)
    ring.put([Frame(2, b"\x02")] * 16, 0)
    assert frames_of(taken) == [(0, Frame(1, b"\x01"))]


def test_a_long_frame_leaves_nothing_in_the_slot_of_a_short_one(ring):
    for _ in range(2):
        ring.put([Frame(1, b"\xff" * 64, 0, FD)] * 16, 0)
        ring.take(16)
    ring.put([Frame(2, b"\x01")], 0)
    assert bytes(ring.take(1)["data"][0]) == b"\x01" + bytes(63)


PUTTING = """
import sys
from bus.frame import Frame
from hil.recording.ring import Ring

ring = Ring.attach(int(sys.argv[1]))
for count in range(int(sys.argv[2])):
    ring.put([Frame(1, b"", count, 0)], 0)
"""


def test_another_process_never_reads_a_count_that_is_half_written():
    """Frames one by one from another process: all come, in order, whatever moment the counts are read at."""
    ring, count = Ring.create(slots=1 << 18), 200_000
    with subprocess.Popen(
        [sys.executable, "-c", PUTTING, str(ring.fileno()), str(count)], pass_fds=(ring.fileno(),)
    ) as putting:
        seen = 0
        while putting.poll() is None:
            taken = ring.take(1 << 15)
            assert taken["at_ns"].tolist() == list(range(seen, seen + len(taken)))
            seen += len(taken)
        assert putting.returncode == 0
    assert seen + len(ring.take(count)) == count
    ring.close()


def test_a_ring_needs_a_slot():
    with pytest.raises(ValueError, match="slots=0"):
        Ring.create(slots=0)


def test_the_record_is_packed():
    """Both sides of the ring and the journal of fields agree on 80 bytes without holes."""
    assert RECORD.itemsize == 80 == sum(np.dtype(RECORD[name]).itemsize for name in RECORD.names)
