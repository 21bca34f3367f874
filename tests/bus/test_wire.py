"""The modelled wire obeys ISO 11898-1: one frame at a time, lowest identifier first."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus.bits import CLASSIC_TAIL, classic_bits
from bus.frame import EXTENDED, Frame
from bus.wire import Wire, wire_bits

frames = st.builds(
    lambda extended, identifier, data: Frame(
        identifier | EXTENDED if extended else identifier & 0x7FF, bytes(data)
    ),
    st.booleans(),
    st.integers(0, 0x1FFF_FFFF),
    st.binary(max_size=8),
)


def drain(wire, until_ns=10**12):
    return [frame for _, frame in wire.take(until_ns)]


def test_the_length_of_a_frame_is_that_of_the_standard():
    """SOF 1, identifier 11, RTR, IDE, r0, DLC 4, CRC 15 + 1, ACK 2, EOF 7, space 3 = 47; extended + 20."""
    assert wire_bits(Frame(0x123, bytes(8))) == 111
    assert wire_bits(Frame(0x123 | EXTENDED, bytes(8))) == 131
    assert wire_bits(Frame(0x123, b"")) == 47


@given(frames)
def test_the_length_is_that_of_the_bus_model_without_its_stuff_bits(frame):
    assert wire_bits(frame) == len(classic_bits(frame)) + CLASSIC_TAIL


@given(st.lists(frames, max_size=20))
def test_frames_follow_one_another_without_overlap_and_none_is_lost(sent):
    wire = Wire(500_000)
    wire.put(sent, 1000, "plant")
    arrived = drain(wire)
    assert sorted(f[:2] for f in arrived) == sorted(f[:2] for f in sent)
    end = 1000
    for frame in arrived:
        assert frame.at_ns == end + 2000 * wire_bits(frame)
        end = frame.at_ns


def test_what_waits_is_sent_later_and_keeps_its_place():
    wire = Wire(500_000)
    wire.put([Frame(0x300, bytes(8)), Frame(0x100, bytes(8))], 0, "plant")
    first = wire.take(230_000)
    assert [(sender, frame.can_id) for sender, frame in first] == [("plant", 0x100)]
    assert wire.backlog == 1
    wire.put([Frame(0x200, bytes(8))], 240_000, "ecu")
    assert [frame.can_id for frame in drain(wire)] == [0x200, 0x300]


def test_a_frame_offered_while_the_wire_is_taken_waits_for_it():
    wire = Wire(500_000)
    wire.put([Frame(0x100, bytes(8))], 100_000, "plant")
    wire.take(400_000)  # it ends at 322 us
    wire.put([Frame(0x200, bytes(8))], 300_000, "ecu")
    assert [frame.at_ns for frame in drain(wire)] == [544_000]


def test_frames_of_equal_identifier_keep_their_order():
    wire = Wire()
    wire.put([Frame(0x100, bytes([n])) for n in range(8)], 0, "plant")
    assert [frame.data[0] for frame in drain(wire)] == list(range(8))


def test_a_bit_rate_of_zero_is_refused():
    with pytest.raises(ValueError, match="bit_rate=0"):
        Wire(0)
