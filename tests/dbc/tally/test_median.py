"""The running median: exact while the values are few, within half a bin of the exact one beyond that."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dbc.tally.median import WAITING, RunningMedian

PIECES = st.lists(st.lists(st.integers(-(10**12), 10**12), max_size=20), min_size=1, max_size=10)


def taken(pieces, **options):
    median = RunningMedian(**options)
    for piece in pieces:
        median.add(np.array(piece, np.int64))
    return median


@given(PIECES)
def test_it_is_the_median_of_all_pieces(pieces):
    every = [value for piece in pieces for value in piece]
    assert taken(pieces).value() == (float(np.median(every)) if every else None)


@given(PIECES, st.integers(2, 16))
def test_beyond_its_room_it_lies_within_half_a_bin(pieces, room):
    median = taken(pieces, distinct=room)
    every = [value for piece in pieces for value in piece]
    if every:
        found = median.value()
        half_a_bin = ((1 << median.shift) - 1) / 2
        assert abs(found - float(np.median(every))) <= half_a_bin


@pytest.mark.parametrize("pieces", [10, 100])
def test_its_room_is_bounded(pieces):
    rng = np.random.default_rng(1)
    median = taken([rng.integers(0, 10**9, WAITING) for _ in range(pieces)], distinct=1000)
    assert 500 < median._bins.size <= 1000
    assert median._counts.sum() == pieces * WAITING
