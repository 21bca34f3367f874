"""Lines of a candump log from rows are those from frames."""

from hypothesis import given
from hypothesis import strategies as st

from bus.frame import ERROR, EXTENDED, REMOTE, Frame
from bus.rows import Frames
from dbc.recordings.candump_rows import lines_of
from dbc.recordings.writer import CandumpWriter, candump_line
from tests.bus.rows import table_of

frames = st.builds(
    lambda identifier, kind, data, at_ns: Frame(
        identifier & (0x1FFF_FFFF if kind & (EXTENDED | ERROR) else 0x7FF) | kind,
        bytes(len(data)) if kind & REMOTE else data,
        at_ns,
    ),
    st.integers(0, 0x1FFF_FFFF),
    st.sampled_from([0, EXTENDED, REMOTE, EXTENDED | REMOTE, ERROR]),
    st.binary(max_size=8),
    st.integers(0, 2**63 - 1) | st.integers(0, 10**11),
)


@given(st.lists(frames, max_size=20), st.sampled_from(["can0", "vcan12", "x"]))
def test_lines_of_rows_are_those_of_frames(sent, channel):
    text = "".join(f"{candump_line(frame, channel)}\n" for frame in sent)
    assert lines_of(table_of(sent), channel) == text


def test_a_log_holds_rows_and_frames_in_their_order(tmp_path):
    sent = [Frame(0x123, b"\xab\x01", 1_500_000_000), Frame(0x18FF0102 | EXTENDED, b"", 2_000_001_000)]
    frames = Frames()
    frames.append(sent[0])
    frames.add(table_of(sent[1:]))
    with CandumpWriter(tmp_path / "a.log") as writer:
        writer.write_all(frames, "can0")
    expected = "(0000000001.500000) can0 123#AB01\n(0000000002.000001) can0 18FF0102#\n"
    assert (tmp_path / "a.log").read_text() == expected
