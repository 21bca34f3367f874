"""Taps: what goes through is untouched, traced frames leave a row, a cut-off file still reads."""

import numpy as np
import pytest

from bus.frame import Frame
from bus.virtual import VirtualBus
from dbc import loader_database
from hil.gateway.hops import Kind
from hil.gateway.tap import ROW, StampWriter, Tap, TappedTiming, read_stamps, ticks_of

DATABASE = loader_database()


def message(name, **values):
    codec = DATABASE.by_name[name]
    return Frame(codec.can_id, codec.encode_dict(dict.fromkeys(codec.signals, 0) | values))


@pytest.fixture
def tapped(tmp_path):
    """(the tapped end, the other end, file)."""
    file = tmp_path / "stamps.test"
    bus = VirtualBus(clock=lambda: 1000)
    with bus.connect() as inner, bus.connect() as other, StampWriter(file) as stamps:
        yield Tap(inner, stamps, DATABASE), other, file, stamps


def test_frames_go_through_as_they_are(tapped):
    tap, other, _, _ = tapped
    frames = [message("Articulation", SampleSequence=7), Frame(0x123, b"\1"), message("NormalForces")]
    for frame in frames:
        other.send(frame)
        tap.send(frame)
    strip = [(frame.can_id, frame.data) for frame in frames]
    assert [(f.can_id, f.data) for f in tap.drain()] == strip
    assert [(f.can_id, f.data) for f in other.drain()] == strip
    assert tap.statistics().sent == tap.statistics().received == 3


def test_traced_frames_leave_a_row_with_their_number_and_stamps(tapped):
    tap, other, file, stamps = tapped
    other.send(message("Articulation", SampleSequence=40_000))
    other.send(message("NormalForces"))
    tap.drain()
    tap.send(message("Limits"))
    tap.send(message("EcuStatus", EchoSequence=40_000))
    stamps.close()
    rows = read_stamps(file)
    assert rows[:, :2].tolist() == [
        [Kind.HEARD_SAMPLE, 40_000],
        [Kind.SENT_LIMITS, 0],
        [Kind.SENT_STATUS, 40_000],
    ]
    assert rows[:, 2].tolist() == [1000, 0, 0]  # the bus' stamp of what was heard
    assert np.all(np.diff(rows[:, 3]) >= 0)
    assert rows[0, 3] > 0


def test_a_frame_too_short_for_its_message_leaves_no_row(tapped):
    tap, other, file, stamps = tapped
    other.send(Frame(message("EcuStatus").can_id, b"\1\2"))
    assert len(tap.drain()) == 1
    stamps.close()
    assert read_stamps(file).shape == (0, 4)


def test_ticks_are_among_the_stamps_and_read_back_without_the_rest(tmp_path):
    file = tmp_path / "stamps.ticks"
    with StampWriter(file) as stamps:
        timing = TappedTiming(stamps)
        timing.add(100, 105, 125)
        stamps.add(Kind.SENT_SAMPLE, 7, 0, 130)
        timing.add(200, 206, 206)
    rows = read_stamps(file)
    assert rows[:, 0].tolist() == [Kind.TICK, Kind.SENT_SAMPLE, Kind.TICK]
    assert rows[[0, 2], 3].tolist() == [105, 206]  # a hop begins with the start of the tick
    ticks = {name: column.tolist() for name, column in ticks_of(rows).items()}
    assert ticks == {"due_ns": [100, 200], "lateness_ns": [5, 6], "execution_ns": [20, 0]}


def test_a_file_cut_off_by_a_kill_reads_up_to_its_last_whole_row(tmp_path):
    file = tmp_path / "stamps.killed"
    file.write_bytes(ROW.pack(0, 1, 2, 3) + ROW.pack(4, 5, 6, 7)[:-3])
    assert read_stamps(file).tolist() == [[0, 1, 2, 3]]
    assert read_stamps(tmp_path / "none").shape == (0, 4)


def test_rows_are_on_disk_long_before_the_end(tmp_path):
    file = tmp_path / "stamps.running"
    with StampWriter(file) as stamps:
        for n in range(1000):
            stamps.add(0, n, 0, 0)
        assert len(read_stamps(file)) > 900
