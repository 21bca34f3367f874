"""candump logs: every form of line, damage reported by number and reason, and what we write reads back."""

import gzip
import zlib

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bus.frame import ERROR, EXTENDED, FD, REMOTE, Frame
from dbc.errors import LogError
from dbc.recordings.logfile import parse_candump, read_candump
from dbc.recordings.writer import CandumpWriter, candump_line


def frames(table):
    return [
        Frame(int(c), bytes(d[:n]) if not int(c) & REMOTE else bytes(int(n)), int(t), int(f))
        for t, c, n, f, d in zip(
            table.time_ns, table.can_id, table.length, table.flags, table.data, strict=True
        )
    ]


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        (
            "(1436509052.249713) vcan0 044#2A366C2BBA",
            Frame(0x44, bytes.fromhex("2A366C2BBA"), 1436509052249713000),
        ),
        ("(0.170500) can0 0CF00300#FF00", Frame(0x0CF00300 | EXTENDED, b"\xff\x00", 170500000)),
        ("(0.1) can0 123##1AABB", Frame(0x123, b"\xaa\xbb", 100_000_000, FD | 1)),
        ("(0.1) can0 123#R", Frame(0x123 | REMOTE, b"", 100_000_000)),
        ("(0.1) can0 123#R4", Frame(0x123 | REMOTE, bytes(4), 100_000_000)),
        ("(0.1) can0 20000080#0000000000000000", Frame(0x80 | ERROR, bytes(8), 100_000_000)),
        ("(0.1) can0 123#", Frame(0x123, b"", 100_000_000)),
        ("(0.1) can0 123#11.22", Frame(0x123, b"\x11\x22", 100_000_000)),
        ("(0.1) can0 123#1122 R", Frame(0x123, b"\x11\x22", 100_000_000)),
        ("  (0.1)  can0  123#1122\r", Frame(0x123, b"\x11\x22", 100_000_000)),
        ("(0.123456789) can0 123#11", Frame(0x123, b"\x11", 123_456_789)),
    ],
)
def test_every_form_of_line(line, expected):
    table = parse_candump(line.encode())
    assert table.damaged_count == 0, [str(d) for d in table.damaged]
    assert frames(table) == [expected]


@pytest.mark.parametrize(
    ("line", "word"),
    [
        ("can0 123#11", "time stamp"),
        ("(abc) can0 123#11", "time stamp"),
        ("(1.0 can0 123#11", "time stamp"),
        ("(1.0)", "channel"),
        ("(1.0) can0", "channel"),
        ("(1.0) can0 12#11", "identifier"),
        ("(1.0) can0 FFF#11", "identifier"),
        ("(1.0) can0 FFFFFFFF#11", "identifier"),
        ("(1.0) can0 123-11", "#"),
        ("(1.0) can0 123#1", "pairs"),
        ("(1.0) can0 123#1G", "pairs"),
        ("(1.0) can0 123#112233445566778899", "more data"),
        ("(1.0) can0 123##", "pairs"),
        ("(1.0) can0 123#11 and more", "follows"),
    ],
)
def test_a_damaged_line_is_reported_and_skipped(line, word):
    good = "(1.0) can0 123#11"
    table = parse_candump(f"{good}\n{line}\n\n{good}\n".encode())
    assert len(table) == 2
    assert table.damaged_count == 1
    assert table.damaged[0].at == 2
    assert word in str(table.damaged[0])


def test_what_a_damaged_line_left_behind_is_wiped():
    """The row of a damaged line is used again by the next frame."""
    table = parse_candump(b"(1.0) can0 123#11223344556677889\n(1.0) can0 123#AA\n")
    assert bytes(table.data[0]) == b"\xaa" + bytes(7)


def test_a_line_cut_off_by_a_kill_loses_only_itself(tmp_path):
    """Wherever the cut is: half a frame can look like a whole one."""
    file = tmp_path / "cut.log"
    whole = "".join(f"({i}.000000) can0 123#{i:02X}1122\n" for i in range(50))
    for cut in range(1, len("(49.000000) can0 123#311122")):
        file.write_text(whole[:-cut])
        table = read_candump(file)
        assert len(table) == 49
        assert [str(damage) for damage in table.damaged] == [
            "line 50: the file ends inside this line; skipped"
        ]


def test_many_damaged_lines_are_counted_and_the_first_hundred_named():
    table = parse_candump(b"(1.0) can0 123#11\n" + b"rubbish\n" * 500)
    assert table.damaged_count == 500
    assert [d.at for d in table.damaged] == list(range(2, 102))


@st.composite
def any_frame(draw):
    extended = draw(st.booleans())
    word = draw(st.integers(0, 0x1FFFFFFF)) | EXTENDED if extended else draw(st.integers(0, 0x7FF))
    at_ns = draw(st.integers(0, 2_000_000_000)) * 1_000_000_000 + draw(st.integers(0, 999_999)) * 1000
    kind = draw(st.sampled_from(["classic", "fd", "remote"]))
    if kind == "fd":
        return Frame(word, draw(st.binary(max_size=64)), at_ns, FD | draw(st.integers(0, 3)))
    if kind == "remote":
        return Frame(word | REMOTE, bytes(draw(st.integers(0, 8))), at_ns)
    return Frame(word, draw(st.binary(max_size=8)), at_ns)


@given(st.lists(st.tuples(any_frame(), st.sampled_from(["can0", "vcan1"])), max_size=20))
@settings(deadline=None)
def test_what_is_written_reads_back(written):
    text = "".join(f"{candump_line(frame, channel)}\n" for frame, channel in written)
    table = parse_candump(text.encode())
    assert table.damaged_count == 0
    assert frames(table) == [frame for frame, _ in written]
    assert [table.channels[c] for c in table.channel] == [channel for _, channel in written]


def test_python_can_reads_what_we_write(tmp_path):
    file = tmp_path / "ours.log"
    sent = [Frame(0x123, b"\x01\x02", 1_500_000_000), Frame(0x18FEF100 | EXTENDED, bytes(8), 1_600_000_000)]
    with CandumpWriter(file) as writer:
        for frame in sent:
            writer.write(frame, "can0")
    with can.CanutilsLogReader(file) as reader:
        read = list(reader)
    assert [(m.arbitration_id, bytes(m.data), m.is_extended_id) for m in read] == [
        (0x123, b"\x01\x02", False),
        (0x18FEF100, bytes(8), True),
    ]
    assert [m.timestamp for m in read] == [1.5, 1.6]


@pytest.mark.parametrize("step_ns", [1_000_000, 100_000_000, -100_000_000])
def test_a_kill_loses_no_more_of_a_quiet_bus_than_of_a_full_one(tmp_path, step_ns):
    """Whatever the distance of the frames: what is more than 0.1 s older than the last one is in the file."""
    file = tmp_path / "open.log"
    with CandumpWriter(file) as writer:
        for k in range(300):
            writer.write(Frame(0x123, b"", 10**12 + k * step_ns), "can0")
        waiting_ns = (299 - file.read_text().count("\n")) * abs(step_ns)
        assert waiting_ns <= 100_000_000
        writer.flush()
        assert file.read_text().count("\n") == 300


LINES = [
    *("(1436509052.249713) can0 044#2A366C2BBA", "(0.170500) can0 0CF00300#FF00", "(0.1) can0 123##1AABB"),
    *(
        "(12.345678) can0 123#",
        "(12.345678) can0 1FFFFFFF#0123456789abcdef",
        "(9999999999.999999) can0 7FF#00",
    ),
    *(
        "(12.345678) can0 20000080#0000000000000000",
        "(12.345678) longername 123#11",
        "(1.000000) can0 123#R4",
    ),
    *("(1.000000) can0 123#11.22", "(1.000000) can0 123#112233445566778899", "(1.000000)  can0 123#11"),
    *("(1.000000) can0 FFF#11", "(1.000000) can0 FFFFFFFF#11", "(12345678901.000000) can0 123#11"),
]
STRANGE = st.sampled_from("(). #R09aAfFgG@`/:\x19\t\r_-")


EVERY_BYTE = [chr(code) for code in range(1, 128) if code != 10]


@pytest.mark.parametrize("line", LINES)
def test_a_line_with_any_byte_replaced_means_the_same_wherever_it_stands(line):
    for at in range(len(line)):
        for letter in EVERY_BYTE if at % 7 == 0 or at > len(line) - 3 else "(). #R09aAfFgG@`/:\x19\t\r":
            assert_means_the_same_everywhere(line[:at] + letter + line[at + 1 :] + "\n")


@given(
    st.sampled_from(LINES), st.lists(st.tuples(st.integers(0, 50), STRANGE), max_size=3), st.sampled_from(["\n", "\r\n"])
)  # fmt: skip
@settings(deadline=None)
def test_a_line_with_bytes_inserted_means_the_same_wherever_it_stands(line, changes, end):
    for at, letter in changes:
        line = line[:at] + letter + line[at:]
    assert_means_the_same_everywhere(line + end)


def assert_means_the_same_everywhere(line):
    """The last 64 bytes of a text are read step by step, usual lines before them eight bytes at a time."""
    alone = parse_candump(line.encode())
    usual = "(1.000000) can0 123#11\n"
    among = parse_candump((usual + line + 4 * usual).encode())
    assert len(among) == 5 + len(alone)
    inside = among.select(slice(1, 1 + len(alone)))
    assert frames(inside) == frames(alone)
    assert [among.channels[c] for c in inside.channel] == list(alone.channels)
    assert [d.reason for d in among.damaged] == [d.reason for d in alone.damaged]
    assert bytes(among.data[-1]) == b"\x11" + bytes(among.data.shape[1] - 1)


def test_chunks_and_compression_change_nothing(tmp_path, monkeypatch):
    text = "".join(f"({i}.5) can{i % 3} 18FEF1{i % 256:02X}#{i:04X}\n" for i in range(2000)).encode()
    plain, packed = tmp_path / "a.log", tmp_path / "a.log.gz"
    plain.write_bytes(text)
    packed.write_bytes(gzip.compress(text))
    whole = frames(parse_candump(text))
    monkeypatch.setattr("dbc.recordings.logfile.PIECE", 1000)
    heard = []
    assert frames(read_candump(plain, lambda read, total: heard.append((read, total)))) == whole
    assert frames(read_candump(packed)) == whole
    assert heard[-1] == (len(text), len(text))


def test_unreadable_files_are_one_clear_error(tmp_path):
    binary = tmp_path / "picture.png"
    binary.write_bytes(bytes(range(256)) * 10)
    packed = tmp_path / "rubbish.log.gz"
    packed.write_bytes(b"\x1f\x8b" + bytes(100))
    for file, words in (
        (binary, "not a candump log"),
        (packed, "breaks off"),
        (tmp_path / "none.log", "cannot read"),
        (tmp_path, "cannot read"),
    ):
        with pytest.raises(LogError, match=words) as error:
            read_candump(file)
        assert str(file) in str(error.value)


def test_of_a_compressed_file_cut_short_everything_before_the_cut_is_read(tmp_path):
    """A recorder killed, a copy interrupted: what can be decompressed counts, the line the cut goes through does not."""
    text = "".join(f"({i}.5) can0 18FEF1{i % 256:02X}#{i * 7919 % 65536:04X}\n" for i in range(5000)).encode()
    whole, file = gzip.compress(text), tmp_path / "cut.log.gz"
    for size in (len(whole) // 2, len(whole) - 8, len(whole) - 1):
        file.write_bytes(whole[:size])
        inflated = zlib.decompressobj(31).decompress(whole[:size])
        lines = inflated[: inflated.rfind(b"\n") + 1]
        table = read_candump(file)
        assert frames(table) == frames(parse_candump(lines))
        assert len(table) > 1000
        assert table.damaged_count == 1
        assert table.damaged[0].at == len(table) + 1
        assert "breaks off" in table.damaged[0].reason


def test_a_compressed_file_may_have_several_members(tmp_path):
    """`cat a.log.gz b.log.gz > both.log.gz` is a valid file."""
    line = b"(1.0) can0 123#11\n"
    file = tmp_path / "both.log.gz"
    file.write_bytes(gzip.compress(line) + gzip.compress(line * 2))
    table = read_candump(file)
    assert len(table) == 3
    assert table.damaged_count == 0


def test_damage_is_numbered_through_and_bounded(tmp_path, monkeypatch):
    """Every third line is damaged; numbers go on over the pieces, which are parsed side by side."""
    monkeypatch.setattr("dbc.recordings.logfile.PIECE", 500)
    file = tmp_path / "damaged.log"
    file.write_text("".join("rubbish\n" if i % 3 == 0 else "(1.0) can0 123#11\n" for i in range(1, 901)))
    table = read_candump(file)
    assert table.damaged_count == 300
    assert [d.at for d in table.damaged] == [3 * k for k in range(1, 101)]


def test_can_fd_that_comes_late_widens_what_came_before(tmp_path, monkeypatch):
    monkeypatch.setattr("dbc.recordings.logfile.PIECE", 100)
    file = tmp_path / "mixed.log"
    file.write_text("(1.0) can0 123#0102030405060708\n" * 20 + f"(2.0) can0 123##1{'AB' * 64}\n")
    read = frames(read_candump(file))
    assert [frame.data for frame in read] == [bytes(range(1, 9))] * 20 + [b"\xab" * 64]


def test_more_channels_than_can_be_numbered_is_one_clear_error(tmp_path):
    file = tmp_path / "channels.log"
    file.write_text("".join(f"(1.0) can{i} 123#11\n" for i in range(65)))
    table = read_candump(file)
    assert len(table.channels) == 64
    assert [d.at for d in table.damaged] == [65]


def test_an_empty_file_has_no_frames(tmp_path):
    file = tmp_path / "empty.log"
    file.touch()
    assert len(read_candump(file)) == 0
