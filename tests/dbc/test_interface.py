"""What loader.dbc and reference.dbc promise: every signal fits, every message has its times, units are known."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus.bits import classic_bits, stuffed
from bus.frame import EXTENDED, Frame
from dbc import FOLDER, loader_database, reference_database
from dbc.database import Database
from dbc.errors import DatabaseError
from dbc.handbook import page
from dbc.load import bus_load, frame_bits
from dbc.units import SI

DOCS = Path(__file__).resolve().parents[2] / "docs" / "reference"
DATABASES = {"loader": loader_database, "reference": reference_database}
each = pytest.mark.parametrize("database", [make() for make in DATABASES.values()], ids=list(DATABASES))


@each
def test_every_range_fits_its_bits_and_every_unit_is_known(database):
    for codec in database.by_name.values():
        for signal in codec.layout:
            low, high = sorted(raw * signal.scale + signal.offset for raw in signal.raw_limits)
            assert signal.minimum is not None, f"{codec.name}.{signal.name} has no range"
            assert low - 1e-9 <= signal.minimum < signal.maximum <= high + 1e-9, f"{codec.name}.{signal.name}"
            assert signal.unit in SI, f"{codec.name}.{signal.name}: unit {signal.unit}"
            assert signal.comment, f"{codec.name}.{signal.name} is not explained"


@each
def test_every_message_has_a_cycle_time_a_sender_a_receiver_and_a_comment(database):
    for codec in database.by_name.values():
        assert codec.cycle_ns > 0, codec.name
        assert len(codec.senders) == 1, codec.name
        assert codec.receivers, codec.name
        assert codec.comment, codec.name


@each
def test_protected_messages_carry_crc_and_counter_where_the_profile_has_them(database):
    ids = []
    for codec in database.by_name.values():
        if codec.e2e_data_id is None:
            assert "Crc" not in codec.signals, codec.name
            continue
        ids.append(codec.e2e_data_id)
        crc, counter = codec.by_signal["Crc"], codec.by_signal["AliveCounter"]
        assert (crc.start, crc.length) == (0, 8)
        assert (counter.start, counter.length) == (8, 4)
    assert len(ids) == len(set(ids))


def test_identifiers_are_unique_over_both_buses():
    """A gateway may carry both."""
    ids = [codec.can_id for make in DATABASES.values() for codec in make().by_name.values()]
    assert len(ids) == len(set(ids))
    assert all(can_id & EXTENDED for can_id in ids)


@given(st.binary(max_size=8), st.integers(0, 0x1FFFFFFF), st.booleans())
def test_frame_lengths_bound_the_bits_of_any_frame(data, number, extended):
    """Against the bit-exact encoder, which computes CRC and stuff bits of the very frame."""
    frame = Frame(number | EXTENDED if extended else number & 0x7FF, data)
    bits = len(stuffed(classic_bits(frame))) + 13
    least, most = frame_bits(len(data), extended=extended)
    assert least <= bits <= most


def test_frame_lengths_of_the_literature():
    """Davis et al. 2007: 135 bits for 8 bytes with an 11-bit identifier, 160 with 29 bits; 55 without data."""
    assert frame_bits(8, extended=False)[1] == 135
    assert frame_bits(8, extended=True)[1] == 160
    assert frame_bits(0, extended=False)[1] == 55


def test_the_bus_is_not_overloaded():
    """58 % at 500 kbit/s in the worst case; above 80 % low priorities would starve under jitter."""
    load = bus_load(loader_database().by_name.values(), 500_000)
    assert 0.4 < load.least < load.most < 0.8


@pytest.mark.parametrize(
    ("name", "title", "make"),
    [
        ("can.md", "The bus between machine and ECU", loader_database),
        ("reference-bus.md", "The bus of the test instrumentation", reference_database),
    ],
)
def test_the_reference_pages_are_current(name, title, make):
    assert (DOCS / name).read_text(encoding="utf-8") == page(title, make()), "run scripts/dbc-docs"


def test_every_standard_deviation_has_the_unit_of_its_signal():
    database = loader_database()
    assert len(database.uncertainties) == 6
    for of, (codec, signal) in database.uncertainties.items():
        message, _, name = of.partition(".")
        estimate = database.by_name[message].by_signal[name]
        assert (codec.is_optional, signal.unit) == (True, estimate.unit)
        assert signal.not_available is not None
        assert signal.start_value == signal.not_available


def test_a_standard_deviation_of_nothing_is_refused(tmp_path):
    """The error names the signal and what it refers to."""
    text = (FOLDER / "loader.dbc").read_text(encoding="utf-8")
    file = tmp_path / "wrong.dbc"
    file.write_text(text.replace('"NormalForces.FrontLeft"', '"NormalForces.Front"'), encoding="utf-8")
    with pytest.raises(DatabaseError, match=r"NormalForceFrontLeft: UncertaintyOf 'NormalForces.Front'"):
        Database.from_file(file)
