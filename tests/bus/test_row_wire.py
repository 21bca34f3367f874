"""The wire over rows carries what the wire over frames carries: the same frames in the same order with the same stamps."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bus.frame import ERROR, EXTENDED, REMOTE, Frame
from bus.row_wire import ECU, PLANT, ROOM, RowWire
from bus.rows import LAYOUT, SENT, columns_of, frames_of
from bus.wire import Wire
from tests.bus.rows import table_of

HALF_NS = 5_000_000
HEARD = frozenset({0x10, 0x20, 0x18FF0000 | EXTENDED})

identifiers = st.sampled_from([0x10, 0x11, 0x20, 0x18FF0000 | EXTENDED, 0x18FF0001 | EXTENDED]) | st.builds(
    lambda identifier, kind: identifier & (0x1FFF_FFFF if kind & EXTENDED else 0x7FF) | kind,
    st.integers(0, 0x1FFF_FFFF),
    st.sampled_from([0, EXTENDED, REMOTE, EXTENDED | REMOTE, ERROR]),
)
frames = st.builds(lambda can_id, data: Frame(can_id, data), identifiers, st.binary(max_size=8))


def rows_of(sent, layout):
    """Frames as columns, and how many."""
    return columns_of(table_of(sent, np.zeros(200, layout))), len(sent)


def both(turns, bit_rate=500_000):
    """What arrives from turns of plant and ECU, of frames and of rows: on the bus, for the ECU, for the plant."""
    wire, by_frames = Wire(bit_rate), ([], [], [])
    rows, by_rows = RowWire(HEARD, bit_rate), ([], [], [])
    for k, sent in enumerate(turns):
        side, now_ns = k % 2, k * HALF_NS
        wire.put(sent, now_ns, side)
        for sender, frame in wire.take(now_ns + HALF_NS):
            by_frames[0].append(frame)
            if sender == PLANT:
                by_frames[1].append(frame)
            elif frame.can_id in HEARD:
                by_frames[2].append(frame)
        rows.carry(*rows_of(sent, (LAYOUT, SENT)[side]), side, now_ns, now_ns + HALF_NS)
        by_rows[1].extend(frames_of(rows.take_to_ecu()))
        if k % 3 == 2:  # what is not taken stays
            by_rows[0].extend(frames_of(rows.take_bus()))
            by_rows[2].extend(rows.take_to_plant())
    by_rows[0].extend(frames_of(rows.take_bus()))
    by_rows[2].extend(rows.take_to_plant())
    return by_frames, by_rows


@given(st.lists(st.lists(frames, max_size=25), max_size=9), st.sampled_from([500_000, 125_000, 45_000]))
@settings(max_examples=60)
def test_rows_arrive_as_frames_do(turns, bit_rate):
    """At low bit rates frames wait for several turns and are overtaken by those with lower identifiers."""
    expected, found = both(turns, bit_rate)
    assert found == expected


def test_a_wire_that_cannot_keep_up_loses_nothing():
    """More wait than the tables have room for at first."""
    burst = [Frame(0x100 + k, k.to_bytes(2, "little")) for k in range(3 * ROOM)]
    expected, found = both([burst, burst, *[[]] * 40])
    assert len(found[0]) == 6 * ROOM
    assert found == expected


def test_sides_are_those_of_the_recording():
    _, (_, to_ecu, to_plant) = both([[Frame(0x10, b"a")], [Frame(0x20, b"b"), Frame(0x21, b"c")], []])
    assert [frame.data for frame in to_ecu] == [b"a"]
    assert [frame.data for frame in to_plant] == [b"b"]
    assert (PLANT, ECU) == (0, 1)
