"""The generated codecs give cantools' values bit for bit: on our files, a real car's, and generated messages."""

import math
import struct
from pathlib import Path

import cantools
import cantools.database.errors
import pytest
from cantools.database import Message
from cantools.database.can import Signal as CantoolsSignal
from cantools.database.conversion import BaseConversion
from hypothesis import given, settings
from hypothesis import strategies as st

from dbc import FOLDER
from dbc.columns import decode_rows
from dbc.database import Database, MessageCodec
from dbc.definitions import parsing
from dbc.errors import DatabaseError, DecodeError, EncodeError
from dbc.recordings.logfile import parse_candump

OURS = ["loader.dbc", "reference.dbc", "j1939.dbc"]


def same(ours, theirs):
    """Equal as numbers, NaN equal to NaN, minus zero not equal to zero."""
    if isinstance(theirs, float) and math.isnan(theirs):
        return math.isnan(ours)
    return ours == theirs and math.copysign(1, ours) == math.copysign(1, theirs)


def assert_decodes_alike(codec, message, data):
    theirs = message.decode(data, decode_choices=False, scaling=True)
    ours = codec.decode_dict(data)
    assert ours.keys() == theirs.keys()
    for name, value in theirs.items():
        assert same(ours[name], value), f"{message.name}.{name}: {ours[name]!r}, cantools {value!r}"


def log_of(can_id, rows):
    """A table of frames through the log reader."""
    text = "".join(
        f"(0.{i:06d}) can0 {can_id & 0x1FFFFFFF:08X}##0{row.hex()}\n" for i, row in enumerate(rows)
    )
    return parse_candump(text.encode())


def assert_columns_alike(codec, message, rows):
    table = log_of(codec.can_id, rows)
    columns = decode_rows(codec, table, table.can_id.nonzero()[0])
    for i, row in enumerate(rows):
        theirs = message.decode(row, decode_choices=False)
        for name, values in columns.signals.items():
            if name in theirs:
                assert same(values[i], theirs[name]), f"{name}: {values[i]!r}, cantools {theirs[name]!r}"
            else:
                assert math.isnan(values[i])


@pytest.mark.parametrize("name", OURS)
def test_every_message_of_our_files(name):
    ours, theirs = Database.from_file(FOLDER / name), cantools.database.load_file(FOLDER / name)
    assert len(ours.by_name) == len(theirs.messages)

    @given(st.binary(min_size=8, max_size=8))
    @settings(max_examples=60, deadline=None)
    def check(data):
        for message in theirs.messages:
            assert_decodes_alike(ours.by_name[message.name], message, data[: message.length])

    check()


@pytest.mark.parametrize("name", OURS)
def test_what_is_decoded_encodes_to_the_same_bits(name):
    """Bits that no signal uses read as zero."""
    ours, theirs = Database.from_file(FOLDER / name), cantools.database.load_file(FOLDER / name)

    @given(st.binary(min_size=8, max_size=8))
    @settings(max_examples=30, deadline=None)
    def check(data):
        for message in theirs.messages:
            codec = ours.by_name[message.name]
            values = codec.decode(data[: codec.length])
            expected = message.encode(dict(zip(codec.signals, values, strict=True)), strict=False)
            assert codec.encode(values) == expected

    check()


@pytest.mark.data
def test_a_foreign_database(recordings: Path):
    file = recordings / "comma2k19_rav4" / "_toyota_2017.dbc"
    ours, theirs = Database.from_file(file, strict=False), cantools.database.load_file(file, strict=False)
    decodable = [m for m in theirs.messages if fits(m)]
    assert len(decodable) > 0.9 * len(theirs.messages)

    @given(st.binary(min_size=64, max_size=64))
    @settings(max_examples=20, deadline=None)
    def check(data):
        for message in decodable:
            assert_decodes_alike(ours.by_name[message.name], message, data[: message.length])

    check()


def fits(message):
    """Whether every signal lies inside its message; this file has some that do not, and cantools cannot read them."""
    try:
        message.decode(bytes(message.length))
    except cantools.database.errors.DecodeError:
        return False
    return True


def place(draw, free, size, *, big):
    """Start bit of a signal of `size` bits that lies on free bits only, which it takes; None if it does not fit."""
    first = draw(st.integers(0, max(0, len(free) - size)))  # in the byte order's own count of bits
    # A bit's place in the frame: little endian counts up from each byte's low end, big endian down.
    absolute = [8 * (p // 8) + (7 - p % 8 if big else p % 8) for p in range(first, first + size)]
    if size > len(free) or not all(free[a] for a in absolute):
        return None
    for a in absolute:
        free[a] = False
    return absolute[0]


@st.composite
def signals(draw, name, free, **kind):
    """A list with a signal on free bits, or an empty one."""
    is_float = draw(st.sampled_from([False, False, False, True]))
    size = draw(st.sampled_from([16, 32, 64]) if is_float else st.integers(1, 64) | st.integers(65, 200))
    big = draw(st.booleans())
    start = place(draw, free, size, big=big)
    if start is None:
        return []
    scale = draw(st.sampled_from([1, 2, -3, 7, 1_000_000, 1.0, 2.0, 0.5, 0.01, -0.0001, 1e-6]))
    offset = draw(st.sampled_from([0, 0, 0.0, 1, -40, 1000, 0.25, -273.15]))
    return [
        CantoolsSignal(
            name=name,
            start=start,
            length=size,
            byte_order="big_endian" if big else "little_endian",
            is_signed=draw(st.booleans()) and not is_float,
            conversion=BaseConversion.factory(scale=scale, offset=offset, is_float=is_float),
            **kind,
        )
    ]


def message_of(draw, length, found):
    extended = draw(st.booleans())
    number = draw(st.integers(0, 0x1FFFFFFF if extended else 0x7FF))
    return Message(
        frame_id=number,
        name="M",
        length=length,
        signals=found,
        is_extended_frame=extended,
        is_fd=length > 8,
        strict=True,
    )


@st.composite
def messages(draw):
    """A message of up to 64 bytes with up to six signals that do not overlap."""
    length = draw(st.sampled_from([1, 2, 3, 5, 8, 12, 20, 48, 64]))
    free = [True] * (8 * length)
    return message_of(draw, length, [s for i in range(6) for s in draw(signals(f"s{i}", free))])


@st.composite
def multiplexed_messages(draw):
    """A selector of 2 bits; four pages, each with its own signals over the same bits, one with a selector of its own."""
    length = draw(st.sampled_from([2, 8, 64]))
    free = [True] * (8 * length)
    start = place(draw, free, 2, big=False)
    found = [CantoolsSignal(name="Page", start=start, length=2, is_multiplexer=True)]
    for page in range(4):
        here = list(free)
        kind = {"multiplexer_ids": [page], "multiplexer_signal": "Page"}
        if page == 3 and (start := place(draw, here, 1, big=False)) is not None:
            found.append(CantoolsSignal(name="Inner", start=start, length=1, is_multiplexer=True, **kind))
            kind = {"multiplexer_ids": [0, 1], "multiplexer_signal": "Inner"}
        found += [s for i in range(3) for s in draw(signals(f"p{page}s{i}", here, **kind))]
    return message_of(draw, length, found)


def assert_encodes_alike(codec, message, values):
    """NaN has many bit patterns, and which one survives is the processor's affair."""
    if not any(math.isnan(value) for value in values.values()):
        try:
            expected = message.encode(values, strict=False)
        except (OverflowError, ValueError, cantools.errors.Error):  # rounding took it out of its bits
            with pytest.raises(EncodeError):
                codec.encode_dict(values)
            return
        assert codec.encode_dict(values) == expected
        if not codec.is_multiplexed:
            assert codec.encode([values[name] for name in codec.signals]) == expected


def rows_of(draw, message, count=3):
    return [draw(st.binary(min_size=message.length, max_size=message.length)) for _ in range(count)]


@given(messages() | multiplexed_messages(), st.data())
@settings(max_examples=400, deadline=None)
def test_generated_messages(message, data):
    codec = MessageCodec(parsing.message_of(message))
    rows = []
    for row in rows_of(data.draw, message):
        try:
            values = message.decode(row, decode_choices=False)
        except cantools.database.errors.DecodeError:  # a page that holds no signal does not exist
            with pytest.raises(DecodeError):
                codec.decode_dict(row)
            continue
        assert_decodes_alike(codec, message, row)
        assert_encodes_alike(codec, message, values)
        rows.append(row)
    if message.signals and rows:
        assert_columns_alike(codec, message, rows)


DBC = """VERSION ""
BU_: Sender Receiver
BO_ 291 Simple: 8 Sender
 SG_ Page M : 0|8@1+ (1,0) [0|0] "" Receiver
 SG_ Speed m0 : 8|16@1- (0.1,-5) [0|0] "km/h" Receiver
 SG_ Angle m1 : 15|16@0- (0.5,0) [0|0] "deg" Receiver

BO_ 2566844672 Extended: 8 Sender
 SG_ Outer M : 0|8@1+ (1,0) [0|0] "" Receiver
 SG_ Inner m2M : 8|8@1+ (1,0) [0|0] "" Receiver
 SG_ Deep m5 : 16|32@1+ (1,0) [0|0] "" Receiver
 SG_ Wide m1 : 16|24@1+ (3,1) [0|0] "" Receiver

BO_ 292 Floats: 12 Sender
 SG_ Single : 0|32@1- (1,0) [0|0] "" Receiver
 SG_ Double : 39|64@0- (2,0.5) [0|0] "" Receiver

BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG","4","5","6","7","8","9","10","11","12","13","StandardCAN_FD","ExtendedCAN_FD";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_ "VFrameFormat" BO_ 2566844672 1;
BA_ "VFrameFormat" BO_ 292 14;
SIG_VALTYPE_ 292 Single : 1;
SIG_VALTYPE_ 292 Double : 2;
SG_MUL_VAL_ 2566844672 Inner Outer 2-2;
SG_MUL_VAL_ 2566844672 Deep Inner 5-7, 9-9;
SG_MUL_VAL_ 2566844672 Wide Outer 1-1, 10-4000;
"""


def test_multiplexing_floats_and_can_fd_as_a_file_writes_them(tmp_path):
    file = tmp_path / "all.dbc"
    file.write_text(DBC)
    ours, theirs = Database.from_file(file), cantools.database.load_file(file)
    assert {name: codec.is_fd for name, codec in ours.by_name.items()} == {
        "Simple": False,
        "Extended": False,
        "Floats": True,
    }
    assert ours.by_name["Extended"].can_id == 0x98FEF100
    rows = {
        "Simple": [bytes([page, 0x12, 0x83, 0x84, 0, 0, 0, 0]) for page in (0, 1)],
        "Extended": [
            bytes([o, i, 1, 2, 3, 0x84, 0, 0]) for o, i in ((2, 5), (2, 6), (2, 9), (1, 0), (200, 9))
        ],
        "Floats": [struct.pack("<f", 1.1) + struct.pack(">d", math.pi)],
    }
    for name, message in ((m.name, m) for m in theirs.messages):
        for row in rows[name]:
            assert_decodes_alike(ours.by_name[name], message, row)
            assert_encodes_alike(ours.by_name[name], message, message.decode(row, decode_choices=False))
        assert_columns_alike(ours.by_name[name], message, rows[name])
    for row in (bytes([3, 0]), bytes([2, 8]), bytes([2, 4])):
        with pytest.raises(DecodeError, match=r"Outer is 3|Inner is [48]"):
            ours.by_name["Extended"].decode_dict(row + bytes(6))


def multiplexed():
    def signal(name, start, length, **kind):
        return CantoolsSignal(name=name, start=start, length=length, **kind)

    return Message(
        frame_id=0x123,
        name="Mux",
        length=8,
        signals=[
            signal("Page", 0, 4, is_multiplexer=True),
            signal("A", 8, 16, multiplexer_ids=[0], multiplexer_signal="Page", is_signed=True),
            signal("Inner", 8, 4, multiplexer_ids=[1, 2], multiplexer_signal="Page", is_multiplexer=True),
            signal("B", 16, 8, multiplexer_ids=[3], multiplexer_signal="Inner"),
            signal("C", 16, 24, multiplexer_ids=[5, 6], multiplexer_signal="Inner"),
            signal("Always", 56, 8),
        ],
    )


def test_an_unknown_page_is_an_error_that_names_it():
    with pytest.raises(DecodeError, match="Page is 9"):
        MessageCodec(parsing.message_of(multiplexed())).decode_dict(bytes([9]) + bytes(7))


def test_encoding_names_the_missing_signal_and_the_unknown_page():
    codec = MessageCodec(parsing.message_of(multiplexed()))
    with pytest.raises(EncodeError, match="no value for signal A"):
        codec.encode_dict({"Page": 0, "Always": 1})
    with pytest.raises(EncodeError, match="Page is 9"):
        codec.encode_dict({"Page": 9, "Always": 1})
    with pytest.raises(DecodeError, match="use decode_dict"):
        codec.decode(bytes(8))
    with pytest.raises(EncodeError, match="use encode_dict"):
        codec.encode([0, 1])


def test_a_short_frame_is_an_error_and_a_longer_one_is_not():
    codec = Database.from_file(FOLDER / "loader.dbc").by_name["Articulation"]
    with pytest.raises(DecodeError, match="4 bytes"):
        codec.decode(bytes(4))
    assert codec.decode(bytes(12)) == codec.decode(bytes(8))


def test_a_value_that_does_not_fit_is_an_error_with_its_range():
    codec = Database.from_file(FOLDER / "loader.dbc").by_name["Articulation"]
    values = dict.fromkeys(codec.signals, 0)
    with pytest.raises(EncodeError, match=r"ArticulationAngle: 90 deg does not fit"):
        codec.encode_dict({**values, "ArticulationAngle": 90})
    with pytest.raises(EncodeError, match="nan"):
        codec.encode_dict({**values, "ArticulationAngle": math.nan})


def test_one_signal_by_hand():
    """Articulation angle: little-endian int16 from bit 12 in steps of 0.002 degrees."""
    raw = struct.pack("<q", -12345 << 12)
    codec = Database.from_file(FOLDER / "loader.dbc").by_name["Articulation"]
    assert codec.decode_dict(raw)["ArticulationAngle"] == -12345 * 0.002


def test_a_broken_file_is_one_clear_error(tmp_path):
    file = tmp_path / "broken.dbc"
    file.write_text("BO_ this is no DBC")
    with pytest.raises(DatabaseError, match=r"broken\.dbc"):
        Database.from_file(file)
    with pytest.raises(DatabaseError, match=r"missing\.dbc"):
        Database.from_file(tmp_path / "missing.dbc")
