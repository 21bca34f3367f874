"""One table from every format; python-can's writers are the reference, damage is reported with its place."""

import contextlib
import resource
import struct
import zlib
from unittest import mock

import can
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bus.frame import BRS, ERROR, ESI, EXTENDED, FD, REMOTE, Frame
from dbc.errors import LogError
from dbc.recordings.blf import CONTAINER_LIMIT
from dbc.recordings.reading import read_frames

FORMATS = ["log", "blf", "asc", "mf4"]
FD_LENGTHS = [0, 1, 8, 12, 64]


@st.composite
def messages(draw):
    """python-can messages a few microseconds to seconds apart, of every kind that all formats carry."""
    stamp_us, made = draw(st.integers(1_500_000_000, 1_900_000_000)) * 1_000_000, []
    for _ in range(draw(st.integers(1, 12))):
        stamp_us += draw(st.integers(1, 5_000_000))
        kind = draw(st.sampled_from(["classic", "classic", "fd", "remote", "error"]))
        extended = draw(st.booleans())
        identifier = draw(st.integers(0, 0x1FFFFFFF if extended else 0x7FF))
        common = {"timestamp": stamp_us / 1e6, "channel": draw(st.integers(0, 2))}
        if kind == "error":
            message = can.Message(is_error_frame=True, **common)
        elif kind == "remote":
            message = can.Message(
                arbitration_id=identifier, is_extended_id=extended, is_remote_frame=True,
                dlc=draw(st.integers(0, 8)), **common,
            )  # fmt: skip
        else:
            size = draw(st.sampled_from(FD_LENGTHS) if kind == "fd" else st.integers(0, 8))
            switched, passive = (draw(st.booleans()), draw(st.booleans())) if kind == "fd" else (False, False)
            message = can.Message(
                arbitration_id=identifier, is_extended_id=extended, data=draw(st.binary(min_size=size, max_size=size)),
                is_fd=kind == "fd", bitrate_switch=switched, error_state_indicator=passive, **common,
            )  # fmt: skip
        made.append(message)
    return made


def frame_of(message):
    """What a table must hold of a python-can message."""
    at_ns = round(message.timestamp * 1e6) * 1000
    if message.is_error_frame:
        return Frame(ERROR, b"", at_ns)
    word = message.arbitration_id | (EXTENDED if message.is_extended_id else 0)
    if message.is_remote_frame:
        return Frame(word | REMOTE, bytes(message.dlc), at_ns)
    flags = FD | BRS * message.bitrate_switch | ESI * message.error_state_indicator if message.is_fd else 0
    return Frame(word, bytes(message.data), at_ns, flags)


def plain(frame):
    """An error frame without its bits, which only candump logs keep."""
    return Frame(ERROR, b"", frame.at_ns) if frame.can_id & ERROR else frame


def write(path, made):
    with can.Logger(path) as logger:
        for message in made:
            logger(message)
    return path


@pytest.mark.parametrize("form", FORMATS)
@given(made=messages())
@settings(deadline=None, max_examples=25)
def test_every_format_gives_the_same_frames(tmp_path_factory, form, made):
    made = storable(form, made)
    table = read_frames(write(tmp_path_factory.mktemp("logs") / f"a.{form}", made))
    assert table.damaged_count == 0, table.damaged
    assert [plain(frame) for frame in table.frames()] == [frame_of(message) for message in made]
    if form != "log":
        assert [table.channels[c] for c in table.channel] == [f"can{message.channel}" for message in made]


def storable(form, made):
    """Without what python-can's writer of that format does not write."""
    if form == "log":
        for message in made:
            message.dlc = 0 if message.is_remote_frame else message.dlc
    if (
        form == "asc"
    ):  # a CAN FD frame without data becomes a remote one; milliseconds of the start lose their zeros
        made = [m for m in made if not m.is_fd or m.data] or [can.Message(timestamp=1.5e9, channel=0)]
        made[0].timestamp = float(int(made[0].timestamp))
    return made


def thousand():
    """Frames that all differ, on two channels, 1 ms apart."""
    return [
        can.Message(
            timestamp=1.6e9 + i * 1e-3, arbitration_id=0x18FEF100 + i % 7, data=i.to_bytes(8, "big"), channel=i % 2
        )
        for i in range(1000)
    ]  # fmt: skip


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """The thousand frames in every format."""
    folder = tmp_path_factory.mktemp("thousand")
    return {form: write(folder / f"all.{form}", thousand()) for form in FORMATS}


@pytest.mark.parametrize("form", ["blf", "asc"])
def test_a_file_cut_off_anywhere_gives_what_is_before_the_cut(files, tmp_path, form):
    content = files[form].read_bytes()
    whole = list(read_frames(files[form]).frames())
    file = tmp_path / f"cut.{form}"
    found = set()
    for size in np.random.default_rng(3).integers(len(content) // 3, len(content) - 20, 12):
        if form == "asc":  # within a line: a file that ends with one is not damaged
            size = content.rindex(b"\n", 0, size) + 12
        file.write_bytes(content[:size])
        table = read_frames(file)
        assert list(table.frames()) == whole[: len(table)]
        assert len(table) > 200
        assert table.damaged_count == 1
        assert ("byte" if form == "blf" else "line") in str(table.damaged[0])
        found.add(len(table))
    assert len(found) > 6  # the longer the file the more frames


def test_a_damaged_line_of_an_asc_is_reported_and_the_rest_read(files, tmp_path):
    lines = files["asc"].read_text().splitlines(keepends=True)
    first = next(i for i, line in enumerate(lines) if "Rx" in line)
    lines[first + 10] = lines[first + 10].replace(" d 8 ", " d 8 XX ", 1)
    lines[first + 20] = lines[first + 20].rsplit(maxsplit=3)[0] + "\n"
    file = tmp_path / "damaged.asc"
    file.write_text("".join(lines))
    table = read_frames(file)
    assert len(table) == 998
    assert [damage.at for damage in table.damaged] == [first + 11, first + 21]
    assert "XX" in table.damaged[0].reason
    assert "5 bytes of data where 8 are announced" in table.damaged[1].reason


def test_damage_inside_a_blf_is_reported_with_its_byte(files, tmp_path):
    content = bytearray(files["blf"].read_bytes())
    content[144:148] = b"XXXX"  # the first object after the file's header
    file = tmp_path / "damaged.blf"
    file.write_bytes(content)
    with pytest.raises(LogError, match=r"not one frame \(byte 144"):
        read_frames(file)


CONTAINERS = 9


@pytest.fixture(scope="module")
def long_blf(tmp_path_factory):
    """A BLF of python-can's own writer whose frames go on from container to container, where each container begins, and its frames."""
    file = tmp_path_factory.mktemp("long") / "long.blf"
    with can.BLFWriter(file, max_container_size=5000) as writer:
        for message in thousand():
            writer.on_message_received(message)
    content = file.read_bytes()
    begins, at = [], 144
    while at < len(content):
        begins.append(at)
        length = int.from_bytes(content[at + 8 : at + 12], "little")
        at += length + length % 4
    assert len(begins) > CONTAINERS
    return content, begins, list(read_frames(file).frames())


def _magic(content, at):
    content[at : at + 4] = b"XXXX"


def _deflated(content, at):
    content[at + 60 : at + 90] = bytes(30)


def _long(content, at):
    content[at + 11] = 0x7F


def _short(content, at):
    content[at + 8 : at + 12] = (40).to_bytes(4, "little")


def _none(content, at):
    content[at + 8 : at + 12] = bytes(4)


@pytest.mark.parametrize("damage", [_magic, _deflated, _long, _short, _none])
@pytest.mark.parametrize("struck", [(0,), (4,), (3, 4), (2, 6)])
def test_what_is_behind_the_damage_in_a_blf_is_read(long_blf, tmp_path, damage, struck):
    """At most the frames of the containers that were struck are lost, with the two that reach into them; the complaint gives the length of the gap."""
    content, begins, whole = long_blf
    damaged = bytearray(content)
    for number in struck:
        damage(damaged, begins[number])
    file = tmp_path / "damaged.blf"
    file.write_bytes(damaged)
    table = read_frames(file)
    read = list(table.frames())
    stamps = [frame.at_ns for frame in read]
    assert stamps == sorted(set(stamps))
    assert set(map(repr, read)) <= set(map(repr, whole))
    per_container = -(-5000 // 48)
    assert len(whole) - len(read) <= len(struck) * (per_container + 2)
    assert table.damaged_count >= 1
    gap_s = max(np.diff(stamps), default=0) * 1e-9
    if struck != (0,) and len(read) < len(whole):
        assert any(f"{gap_s:.3f} s between" in each.reason for each in table.damaged)
    assert read[-1] == whole[-1]


class _Advancing:
    """python-can's object header; an object of length 0, which python-can reads for ever, ends the reading.

    The header may lie across two containers, so that the file's bytes do not show it.
    """

    def __init__(self, layout):
        self._layout = layout
        self.size = layout.size
        self.unpack = layout.unpack

    def unpack_from(self, data, at):
        fields = self._layout.unpack_from(data, at)
        if fields[3] == 0:
            raise can.io.blf.BLFParseError("object of length 0")
        return fields


@given(
    made=messages(),
    size=st.sampled_from([100, 300, 5000]),
    changes=st.lists(
        st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255)), min_size=1, max_size=3
    ),
)
@settings(deadline=None, max_examples=300)
def test_before_the_first_damage_a_blf_is_what_python_can_reads(tmp_path_factory, made, size, changes):
    """Bytes changed anywhere in containers that are not compressed: in headers, lengths, kinds, stamps and data."""
    file = tmp_path_factory.mktemp("blf") / "changed.blf"
    with can.BLFWriter(file, max_container_size=size, compression_level=0) as writer:
        for message in made:
            writer.on_message_received(message)
    content = bytearray(file.read_bytes())
    for place, value in changes:
        content[144 + int(place * (len(content) - 144))] = value
    file.write_bytes(content)
    reference = []
    advancing = _Advancing(can.io.blf.OBJ_HEADER_BASE_STRUCT)
    with (
        mock.patch.object(can.io.blf, "OBJ_HEADER_BASE_STRUCT", advancing),
        file.open("rb") as stream,
        contextlib.suppress(ValueError, struct.error, can.io.blf.BLFParseError),
    ):
        for message in can.BLFReader(stream):
            whole = message.is_remote_frame or message.is_error_frame or message.dlc == len(message.data)
            small = message.arbitration_id <= (0x1FFFFFFF if message.is_extended_id else 0x7FF)
            if whole and small and message.timestamp < 9e9 and message.dlc <= (64 if message.is_fd else 8):
                reference.append(frame_of(message))
    try:
        read = list(read_frames(file).frames())
    except LogError:
        read = []
    assert [plain(f) for f in read[: len(reference)]] == [plain(f) for f in reference]


def test_a_remote_frame_of_can_fd_is_a_remote_frame(tmp_path):
    """There is none (ISO 11898-1), but a damaged file or a careless logger can claim one."""
    file = tmp_path / "claimed.blf"
    with can.BLFWriter(file, compression_level=0) as writer:
        writer.on_message_received(
            can.Message(timestamp=1.5e9, arbitration_id=5, is_extended_id=False, is_fd=True)
        )
    content = bytearray(file.read_bytes())
    at = content.index(b"LOBJ", content.index(b"LOBJ") + 4)  # the message, within the container
    content[at + 32 + 2] |= 0x80  # its flag of a remote frame, behind its header
    file.write_bytes(content)
    (frame,) = read_frames(file).frames()
    assert (frame.can_id, frame.flags) == (5 | REMOTE, 0)


@pytest.mark.parametrize("kept", [0.1, 0.5, 0.9, 0.999])
def test_an_mf4_without_its_structure_is_one_clear_error(files, tmp_path, kept):
    """asammdf writes the structure behind the data: a cut takes it away."""
    content = files["mf4"].read_bytes()
    file = tmp_path / "cut.mf4"
    file.write_bytes(content[: int(kept * len(content))])
    with pytest.raises(LogError, match=r"cut\.mf4: byte \d+: the MF4's structure breaks off"):
        read_frames(file)


def test_the_content_decides_not_the_name(files, tmp_path):
    for form, file in files.items():
        renamed = tmp_path / f"{form}.recording"
        renamed.write_bytes(file.read_bytes())
        assert len(read_frames(renamed)) == 1000


def test_what_holds_no_frame_is_one_clear_error(tmp_path):
    empty, silent, foreign = tmp_path / "empty.blf", tmp_path / "silent.blf", tmp_path / "notes.txt"
    empty.touch()
    with can.Logger(silent):
        pass
    foreign.write_text("a line\n")
    for file, words in (
        (empty, r"empty \(0 bytes"),
        (silent, "not one frame"),
        (foreign, "not a candump log"),
        (tmp_path / "none.mf4", "cannot read the recording: No such file"),
        (tmp_path, "cannot read the recording"),
    ):
        with pytest.raises(LogError, match=words) as error:
            read_frames(file)
        assert str(file) in str(error.value)
        assert "\n" not in str(error.value)


@pytest.mark.parametrize("form", ["log", "blf", "asc", "mf4"])
def test_progress_ends_at_the_whole(files, form, monkeypatch):
    monkeypatch.setattr("dbc.recordings.reading._REPORT_EVERY", 10)
    heard = []
    read_frames(files[form], lambda done, total: heard.append((done, total)))
    assert heard
    assert heard == sorted(heard)
    assert heard[-1][0] <= heard[-1][1]


def test_rows_can_be_selected(files):
    table = read_frames(files["log"])
    odd = table.select(np.arange(len(table)) % 2 == 1)
    assert [frame.data[-1] for frame in odd.frames()][:3] == [1, 3, 5]
    assert len(odd) == 500


@pytest.mark.parametrize("form", ["blf", "mf4"])
@pytest.mark.parametrize("content", [b"<!DOCTYPE html>\n", bytes(500)], ids=["page", "zeros"])
def test_a_file_that_is_not_what_its_name_says_is_called_that(form, content, tmp_path):
    file = tmp_path / f"drive.{form}"
    file.write_bytes(content)
    with pytest.raises(LogError, match=f"does not begin as a {form.upper()} does"):
        read_frames(file)


@pytest.mark.parametrize("junk", [b"\x93\x07 wreck\n\xff\x01\n", bytes(300)], ids=["bytes", "zeros"])
def test_what_is_no_line_of_an_asc_is_counted(junk, files, tmp_path):
    lines = files["asc"].read_bytes().splitlines(keepends=True)
    file = tmp_path / "damaged.asc"
    file.write_bytes(b"".join([*lines[:10], junk, *lines[10:]]))
    table = read_frames(file)
    assert table.damaged_count == max(junk.count(b"\n"), 1)
    assert table.damaged[0].at == 11


def test_a_blf_that_claims_4_gib_takes_no_more_than_there_is(files, tmp_path):
    content = bytearray(files["blf"].read_bytes())
    content[144 + 8 : 144 + 12] = b"\xff\xff\xff\xff"  # length of the first container
    (tmp_path / "long.blf").write_bytes(content)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    table = read_frames(tmp_path / "long.blf")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200 << 10
    assert "breaks off" in table.damaged[0].reason


def test_a_container_that_inflates_without_end_is_damage(files, tmp_path):
    """Zeros deflate a thousand times: 1 MB of a file would be 1 GB of objects."""
    content = files["blf"].read_bytes()[:144]
    bomb = zlib.compress(bytes(CONTAINER_LIMIT + 1), 9)
    head = struct.pack("<4sHHLL", b"LOBJ", 16, 1, 32 + len(bomb), 10) + struct.pack("<H6xL4x", 2, 0)
    (tmp_path / "bomb.blf").write_bytes(content + head + bomb + bytes(len(bomb) % 4))
    with pytest.raises(LogError, match="a container holds more than 64 MiB"):
        read_frames(tmp_path / "bomb.blf")


def behind_links(content, kind):
    """Where the fields of the first block of a kind begin."""
    at = content.index(kind)
    return at, at + 24 + 8 * int.from_bytes(content[at + 16 : at + 24], "little")


@pytest.mark.parametrize("beyond", [1, 1 << 20, 1 << 31])
def test_an_mf4_channel_beyond_its_record_is_one_clear_error(files, tmp_path, beyond):
    """asammdf's C code reads there, and the process ends."""
    content = bytearray(files["mf4"].read_bytes())
    channel, fields = behind_links(content, b"##CN")
    _, group = behind_links(content, b"##CG")
    record_bytes = int.from_bytes(content[group + 24 : group + 28], "little")
    bits = int.from_bytes(content[fields + 8 : fields + 12], "little")
    last_place = record_bytes - bits // 8
    file = tmp_path / "beyond.mf4"
    content[fields + 4 : fields + 8] = (last_place + beyond).to_bytes(4, "little")
    file.write_bytes(content)
    with pytest.raises(
        LogError, match=rf"byte {channel}: the MF4 describes a channel that lies beyond its record"
    ):
        read_frames(file)
    content[fields + 4 : fields + 8] = last_place.to_bytes(4, "little")
    file.write_bytes(content)
    assert len(read_frames(file)) == len(read_frames(files["mf4"]))
