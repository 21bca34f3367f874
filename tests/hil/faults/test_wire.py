"""The faulty wire carries as the plain one does, and what faults add competes like any other frame."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus.frame import EXTENDED, Frame
from bus.wire import Wire, wire_bits
from hil.faults.wire import WAITING_LIMIT, FaultyWire
from tests.hil.faults.traffic import DATABASE, MS, injector

IDS = sorted(DATABASE.by_id)
BIT_NS = 2000


def carried(wire, schedule):
    out = []
    for at_ns, sender, frames in schedule:
        out += wire.take(at_ns)
        wire.put(frames, at_ns, sender)
    return out + wire.take(10_000 * MS)


@given(
    st.lists(
        st.tuples(st.sampled_from(["plant", "ecu"]), st.lists(st.sampled_from(IDS), max_size=16)), max_size=12
    )
)
def test_without_faults_it_is_the_plain_wire(sent):
    schedule = [
        (n * 5 * MS, sender, [Frame(can_id, bytes([i] * 8)) for i, can_id in enumerate(ids)])
        for n, (sender, ids) in enumerate(sent)
    ]
    assert carried(FaultyWire(injector()), schedule) == carried(Wire(), schedule)


def test_a_delayed_frame_asks_for_the_wire_when_it_is_due():
    wire = FaultyWire(injector({"kind": "delay", "message": "BodyRates", "delay_ms": 7.0}))
    frame = Frame(DATABASE.by_name["BodyRates"].can_id, bytes(8))
    wire.put([frame], 0, "plant")
    assert wire.take(7 * MS) == []
    assert wire.take(10 * MS) == [("plant", frame._replace(at_ns=7 * MS + 131 * BIT_NS))]


def test_a_frame_under_way_is_not_interrupted_and_then_the_higher_priority_goes_first():
    wire = FaultyWire(injector())
    low, high = Frame(0x18FF0000 | EXTENDED, bytes(8)), Frame(0x10, bytes(8))
    wire.put([low, low], 0, "plant")
    wire.take(20_000)  # the first frame has begun
    wire.put([high], 20_000, "ecu")
    assert [frame.can_id for _, frame in wire.take(10 * MS)] == [low.can_id, high.can_id, low.can_id]


def test_a_babbling_node_leaves_to_the_others_what_it_does_not_use():
    """111 bits every 444 us are half of 500 kbit/s; the other half carries 131-bit frames back to back."""
    wire = FaultyWire(injector({"kind": "babble", "interval_us": 444.0, "for_s": 1.0}))
    frame = Frame(0x18FF0000 | EXTENDED, bytes(8))
    carried = 0
    for n in range(1000):
        wire.put([frame] * 4, n * MS, "plant")
        carried += sum(f.can_id == frame.can_id for _, f in wire.take((n + 1) * MS))
    assert wire_bits(frame) == 131
    assert carried == pytest.approx(0.5 * 1e9 / (131 * BIT_NS), rel=0.01)


def test_an_overloaded_identifier_loses_its_oldest_frames():
    wire = FaultyWire(injector({"kind": "babble", "interval_us": 50.0, "for_s": 0.1}))
    frames = [Frame(0x18FF0000 | EXTENDED, bytes([n] * 8)) for n in range(50)]
    for n, frame in enumerate(frames):
        wire.put([frame], n * 2 * MS, "plant")
        if n * 2 < 100:
            assert all(f.can_id == 0 for _, f in wire.take(n * 2 * MS))
    kept = [f.data[0] for _, f in wire.take(1000 * MS) if f.can_id]
    assert kept == list(range(50 - WAITING_LIMIT, 50))
