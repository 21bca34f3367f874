"""Compressed tables of a stranger: bounded memory, and the same content as before."""

import gzip
import subprocess
import sys

import numpy as np
import pytest

from diagnosis.reading.tables import SKIPPED_SHOWN, TEXT_FREE, Unreadable, read_table


def test_several_members_and_padding_are_one_table(tmp_path):
    file = tmp_path / "two.csv.gz"
    file.write_bytes(gzip.compress(b"time [s],x\n0,1\n") + gzip.compress(b"1,2\n") + b"\0" * 512)
    (column,) = read_table(file).columns
    assert column.value.tolist() == [1.0, 2.0]


def test_rows_of_another_width_are_counted_and_a_hundred_named(tmp_path):
    file = tmp_path / "wide.csv"
    file.write_text("time [s],x\n0,1\n" + "1,2,3\n" * 250 + "2,5\n")
    found = read_table(file)
    assert len(found.skipped) == SKIPPED_SHOWN + 1
    assert found.skipped[0] == "line 3 has 3 of 2 cells"
    assert found.skipped[-1] == "150 more lines have another number of cells"
    assert found.columns[0].value.tolist() == [1.0, 5.0]


def test_a_decimal_comma_an_empty_and_a_damaged_cell(tmp_path):
    file = tmp_path / "comma.csv"
    file.write_text("time [s];x [m]\n0,5;1,25\n1,0;\n1,5;oops\n")
    (column,) = read_table(file).columns
    assert column.time_s.tolist() == [0.5, 1.5]
    assert np.array_equal(column.value, [1.25, np.nan], equal_nan=True)
    assert column.damage == "1 of 3 cells are not numbers, the first in line 4"


MEASURE = """
import resource, sys
from pathlib import Path
from diagnosis.reading.tables import Unreadable, read_table
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    read_table(Path(sys.argv[1]))
except Unreadable as error:
    print(error)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


@pytest.mark.parametrize("line", [b"\0", b"0,0\n"], ids=["zeros", "shortest rows"])
def test_a_bomb_is_refused_within_bounded_memory(tmp_path, line):
    file = tmp_path / "bomb.csv.gz"
    with gzip.open(file, "wb", compresslevel=1) as out:
        out.write(b"time [s],x\n")
        block = line * (4_000_000 // len(line))
        for _ in range(100):  # 400 MB
            out.write(block)
    done = subprocess.run(
        [sys.executable, "-c", MEASURE, str(file)], capture_output=True, text=True, timeout=120, check=True
    )
    said, kib = done.stdout.splitlines()
    assert "which no recording does" in said
    assert int(kib) * 1024 < 4 * TEXT_FREE


def test_a_bomb_of_one_member_is_unreadable(tmp_path):
    file = tmp_path / "bomb.csv.gz"
    file.write_bytes(gzip.compress(bytes(TEXT_FREE + 1)))
    with pytest.raises(Unreadable, match="64 MiB of text"):
        read_table(file)
