"""Recordings of a stranger: bounded time and memory, and one line that says what is wrong."""

import gzip
import resource
import struct

import pytest

from dbc.errors import LogError
from dbc.recordings import logfile
from dbc.recordings.reading import read_frames

LINE = b"(1700000000.000000) can0 123#0102030405060708\n"
ASC = b"date Sat Sep 30 15:06:13.191 2023\nbase hex  timestamps absolute\ninternal events logged\n"


def peak_mib():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


@pytest.mark.timeout(60)
def test_a_compressed_file_without_ends_of_line_ends_soon(tmp_path):
    """64 MiB of zeros in 64 KiB; joining the pieces took a time that grows with the square of their number."""
    file = tmp_path / "zeros.log.gz"
    file.write_bytes(gzip.compress(bytes(64 << 20), 9))
    before = peak_mib()
    with pytest.raises(LogError, match="a line of more than 65536 bytes"):
        read_frames(file)
    assert peak_mib() - before < 300


def test_frames_before_a_line_without_end_are_kept(tmp_path):
    file = tmp_path / "some.log"
    file.write_bytes(LINE * 10 + b"x" * (3 << 20))
    table = read_frames(file)
    assert len(table) == 10
    assert "a line of more than" in str(table.damaged[-1])


def test_a_compressed_log_cannot_grow_without_bound(tmp_path, monkeypatch):
    monkeypatch.setattr(logfile, "INFLATION_FREE", 1 << 20)
    file = tmp_path / "bomb.log.gz"
    file.write_bytes(gzip.compress(LINE * 1_000_000, 9))
    table = read_frames(file)
    assert 0 < len(table) < 1_000_000
    assert "which no log does" in str(table.damaged[-1])


def test_a_log_of_a_bus_at_rest_is_below_the_limit(tmp_path, monkeypatch):
    """Equal frames a millisecond apart, compressed as well as gzip can."""
    monkeypatch.setattr(logfile, "INFLATION_FREE", 0)
    lines = (
        b"(%d.%06d) can0 123#0000000000000000\n" % divmod(1_700_000_000_000_000 + 1000 * k, 1_000_000)
        for k in range(100_000)
    )
    file = tmp_path / "rest.log.gz"
    file.write_bytes(gzip.compress(b"".join(lines), 9))
    assert len(read_frames(file)) == 100_000


@pytest.mark.parametrize("number", ["FFFFFFFFFF", "FFFFFFFFFFx", "800", "20000000x", "1" * 5000])
def test_an_identifier_of_too_many_bits_is_a_damaged_line(tmp_path, number):
    file = tmp_path / "drive.asc"
    good = b"   0.100000 1  123             Rx   d 2 01 02\n"
    file.write_bytes(ASC + good + f"   0.200000 1  {number}             Rx   d 2 01 02\n".encode() + good)
    table = read_frames(file)
    assert len(table) == 2
    assert table.damaged_count == 1
    assert table.damaged[0].at == 5


@pytest.mark.parametrize("stamp", ["1e30", "9999999999999", "nan"])
def test_a_stamp_beyond_all_clocks_is_a_damaged_line(tmp_path, stamp):
    file = tmp_path / "drive.asc"
    file.write_bytes(ASC + f"   {stamp}.0 1  123 Rx   d 2 01 02\n   0.1 1  123 Rx   d 2 01 02\n".encode())
    assert len(read_frames(file)) == 1


def test_a_link_beyond_the_range_of_a_position_is_a_broken_file(tmp_path):
    """The identification block, and a header block whose first link has all bits set."""
    file = tmp_path / "drive.mf4"
    identification = b"MDF     4.10    loaderhi".ljust(28, b"\0") + struct.pack("<H", 410) + bytes(34)
    file.write_bytes(identification + struct.pack("<4s4xQQ6Q", b"##HD", 104, 6, *[2**64 - 1] * 6) + bytes(32))
    with pytest.raises(LogError, match="structure breaks off"):
        read_frames(file)


def test_the_name_of_a_channel_cannot_steer_a_terminal(tmp_path):
    file = tmp_path / "drive.log"
    file.write_bytes(LINE.replace(b"can0", b"\x1b[31mcan0"))
    assert read_frames(file).channels == ("\\x1b[31mcan0",)
