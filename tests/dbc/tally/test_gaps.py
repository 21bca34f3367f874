"""Gaps of a message: counted as the rules say, one gap after the other, however the stamps are cut into pieces."""

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dbc.tally.gaps import Gaps

PERIOD = 10_000
TOLERANCE, STALE_AFTER = 0.5, 3.0
GAPS = st.lists(
    st.one_of(st.integers(-2000, 60_000), st.sampled_from([5000, 10_000, 15_000, 15_001, 20_000, 30_000])),
    max_size=40,
)


def counted(stamps, window, cuts=()):
    """The counts, and the gaps that were returned as uneven."""
    gaps = Gaps(PERIOD, tolerance=TOLERANCE, stale_after=STALE_AFTER)
    late, early = [], []
    edges = [0, *sorted(min(cut, len(stamps)) for cut in cuts), len(stamps)]
    for begin, end in pairwise(edges):
        uneven = gaps.add(np.array(stamps[begin:end], np.int64))
        late += uneven.late.tolist()
        early += uneven.early.tolist()
    counts = gaps.finish(*window)
    return counts, sorted(late + counts.uneven.late.tolist()), sorted(early + counts.uneven.early.tolist())


def by_the_rules(stamps, window):
    """The rules of `hil.timing.deadlines`, gap by gap."""
    edges = [window[0], *stamps, window[1]]
    gaps = [b - a for a, b in pairwise(edges)]
    late = early = missing = backwards = stale = 0
    last = len(gaps) - 1
    for k, gap in enumerate(gaps):
        stale += max(gap - STALE_AFTER * PERIOD, 0)
        late += gap > PERIOD * (1 + TOLERANCE)
        if k in (0, last):
            missing += gap // PERIOD if gap > PERIOD * (1 + TOLERANCE) else 0
            continue
        backwards += gap < 0
        early += 0 <= gap < PERIOD * (1 - TOLERANCE)
        if gap >= 1.5 * PERIOD:
            after = gaps[k + 1] if k + 1 < last else None
            delayed = after is not None and 0 <= after < PERIOD * (1 - TOLERANCE)
            missing += round((gap + after) / PERIOD) - 2 if delayed else round(gap / PERIOD) - 1
    return late, early, missing, backwards, stale, max(gaps), edges[gaps.index(max(gaps))]


@given(GAPS, st.integers(0, 40_000), st.integers(0, 40_000), st.lists(st.integers(0, 41), max_size=6))
def test_every_count_is_that_of_the_rules(gaps, before, after, cuts):
    stamps = np.cumsum([100_000, *gaps]).tolist() if gaps else []
    window = (min(stamps, default=0) - before, max(stamps, default=0) + after)
    found, late, early = counted(stamps, window, cuts)
    assert (
        found.late, found.early, found.missing, found.backwards, found.stale_ns, found.longest_ns, found.longest_at_ns
    ) == by_the_rules(stamps, window)  # fmt: skip
    assert found.median_ns == (float(np.median(np.diff(stamps))) if len(stamps) > 1 else None)
    assert (found, late, early)[1:] == counted(stamps, window)[1:]


def test_uneven_gaps_are_named_by_their_ends():
    _, late, early = counted([0, 10_000, 26_000, 30_000, 40_000], (0, 40_000))
    assert (late, early) == ([[10_000, 26_000]], [[26_000, 30_000]])


def test_a_delayed_frame_is_recognised_when_the_next_piece_brings_the_next_frame():
    stamps = [0, 10_000, 26_000, 30_000, 40_000]
    assert counted(stamps, (0, 40_000), cuts=[3])[0].missing == 0
    assert counted(stamps[:3], (0, 40_000))[0].missing == 1  # no next frame shows that this one was delayed
