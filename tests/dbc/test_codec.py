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
from dbc.errors import DatabaseError, DecodeError, EncodeError
from dbc.logfile import parse_candump

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


@st.composite
def messages(draw):
    """A message of up to 64 bytes with one to six signals that do not overlap."""
    length = draw(st.sampled_from([1, 2, 3, 5, 8, 12, 20, 48, 64]))
    free = [True] * (8 * length)
    signals = []
    for index in range(draw(st.integers(1, 6))):
        is_float = draw(st.booleans()) and draw(st.booleans())
        size = draw(st.sampled_from([16, 32, 64])) if is_float else draw(st.integers(1, 64))
        big = draw(st.booleans())
        first = draw(st.integers(0, 8 * length - 1))  # in the byte order's own count of bits
        places = range(first, first + size)
        if first + size > 8 * length:
            continue
        # A bit's place in the frame: little endian counts up from each byte's low end, big endian down.
        absolute = [8 * (p // 8) + (7 - p % 8 if big else p % 8) for p in places]
        if not all(free[a] for a in absolute):
            continue
        for a in absolute:
            free[a] = False
        scale = draw(st.sampled_from([1, 2, -3, 0.5, 0.01, 0.0001, 1e-6, 7]))
        offset = draw(st.sampled_from([0, 1, -40, 0.25, -273.15, 1000]))
        start = absolute[0]
        signals.append(
            CantoolsSignal(
                name=f"s{index}",
                start=start,
                length=size,
                byte_order="big_endian" if big else "little_endian",
                is_signed=draw(st.booleans()) and not is_float,
                conversion=BaseConversion.factory(scale=scale, offset=offset, is_float=is_float),
            )
        )
    extended = draw(st.booleans())
    number = draw(st.integers(0, 0x1FFFFFFF if extended else 0x7FF))
    return Message(
        frame_id=number,
        name="M",
        length=length,
        signals=signals,
        is_extended_frame=extended,
        is_fd=length > 8,
        strict=True,
    )


@given(messages(), st.data())
@settings(max_examples=300, deadline=None)
def test_generated_messages(message, data):
    codec = MessageCodec(message)
    rows = [data.draw(st.binary(min_size=message.length, max_size=message.length)) for _ in range(3)]
    for row in rows:
        assert_decodes_alike(codec, message, row)
    if message.signals:
        assert_columns_alike(codec, message, rows)


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


@given(
    page=st.sampled_from([0, 1, 2]), inner=st.sampled_from([3, 5, 6]), rest=st.binary(min_size=6, max_size=6)
)
@settings(deadline=None)
def test_multiplexing_within_multiplexing(page, inner, rest):
    message, codec = multiplexed(), MessageCodec(multiplexed())
    row = bytes([page, inner]) + rest
    assert_decodes_alike(codec, message, row)
    assert_columns_alike(codec, message, [row])
    values = codec.decode_dict(row)
    assert codec.encode_dict(values) == message.encode(values)


def test_an_unknown_page_is_an_error_that_names_it():
    with pytest.raises(DecodeError, match="Page is 9"):
        MessageCodec(multiplexed()).decode_dict(bytes([9]) + bytes(7))


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
