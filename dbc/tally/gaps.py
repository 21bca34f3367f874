"""Counts the gaps between the frames of one cyclic message that are too long, too short or backwards. Pure.

The rules are those of `hil.timing.deadlines`. A gap is judged together with the gap that follows it, because a delayed
frame makes the next gap short; the last gap of a piece therefore waits for the next piece.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dbc.tally.median import RunningMedian

Stamps = NDArray[np.int64]
MISSING_FROM = 1.5
"""Periods from which a gap hides a frame: there the next frame would be nearer than this one."""


@dataclass(frozen=True, slots=True)
class Uneven:
    """The gaps that are too long or too short, (n, 2): the stamps at which each begins and ends."""

    late: Stamps  # also those in which frames are missing
    early: Stamps  # also those that run backwards


@dataclass(frozen=True, slots=True, kw_only=True)
class GapCounts:
    """The gaps of one message within a window, also that before its first frame and that after its last one."""

    late: int
    early: int
    missing: int  # frames that did not come
    backwards: int
    stale_ns: float  # time beyond `stale_after` periods, of all gaps
    median_ns: float | None  # of the gaps between frames; None below two frames
    longest_ns: int
    longest_at_ns: int  # stamp at which the longest gap begins
    uneven: Uneven  # those that `add` has not returned


class Gaps:
    """Takes the stamps of a message in the order of arrival."""

    def __init__(self, period_ns: int, *, tolerance: float, stale_after: float) -> None:
        self._period_ns = period_ns
        self._short_ns, self._long_ns = period_ns * (1 - tolerance), period_ns * (1 + tolerance)
        self._hiding_ns = MISSING_FROM * period_ns
        self._stale_ns = stale_after * period_ns
        self.frames = 0
        self._edges: Stamps = np.empty(0, np.int64)  # the last two stamps: they bound the gap that waits
        self._first_ns = 0
        self._late = self._early = self._missing = self._backwards = 0
        self._stale = 0.0
        self._longest_ns, self._longest_at_ns = np.iinfo(np.int64).min, 0
        self._median = RunningMedian()

    def add(self, at_ns: Stamps) -> Uneven:
        """Count the gaps up to these stamps; returns those whose following gap is known by now."""
        if not self.frames and at_ns.size:
            self._first_ns = int(at_ns[0])
        self.frames += at_ns.size
        waited = self._edges.size == 2
        edges = np.concatenate((self._edges, at_ns))
        self._edges = edges[-2:].copy()
        gaps = np.diff(edges)
        self._count(gaps[waited:], edges[waited:])
        return self._judge(gaps[:-1], gaps[1:].astype(np.float64), edges[:-1])

    def finish(self, start_ns: int, end_ns: int) -> GapCounts:
        """The counts within a window, which holds all stamps. Nothing is added afterwards."""
        last = self._judge(np.diff(self._edges), np.array([np.inf]), self._edges)
        outer = (
            [(start_ns, self._first_ns), (int(self._edges[-1]), end_ns)]
            if self.frames
            else [(start_ns, end_ns)]
        )
        # the outer gaps are cut by the window: they can be too long, never too short, and only whole periods are missing
        late = [(begin, end) for begin, end in outer if end - begin > self._long_ns]
        longest_ns, longest_at_ns = self._longest_ns, self._longest_at_ns
        for place, (begin, end) in enumerate(outer):
            # of equally long gaps the first counts
            if end - begin > longest_ns or (place == 0 and end - begin == longest_ns):
                longest_ns, longest_at_ns = end - begin, begin
        return GapCounts(
            late=self._late + len(late),
            early=self._early,
            missing=self._missing + sum((end - begin) // self._period_ns for begin, end in late),
            backwards=self._backwards,
            stale_ns=self._stale + sum(max(end - begin - self._stale_ns, 0.0) for begin, end in outer),
            median_ns=self._median.value(),
            longest_ns=longest_ns,
            longest_at_ns=longest_at_ns,
            uneven=Uneven(np.concatenate((np.array(late, np.int64).reshape(-1, 2), last.late)), last.early),
        )

    def _count(self, gaps: Stamps, begins: Stamps) -> None:
        """Count what each gap shows by itself."""
        if not gaps.size:
            return
        self._median.add(gaps)
        least, longest = int(gaps.min()), int(gaps.max())
        if longest > self._longest_ns:
            self._longest_ns, self._longest_at_ns = longest, int(begins[np.argmax(gaps)])
        if longest > self._long_ns:
            self._late += int(np.count_nonzero(gaps > self._long_ns))
        if longest > self._stale_ns:
            self._stale += float(np.maximum(gaps - self._stale_ns, 0).sum())
        if least < self._short_ns:
            self._early += int(np.count_nonzero((gaps < self._short_ns) & (gaps >= 0)))
            self._backwards += int(np.count_nonzero(gaps < 0))

    def _judge(self, gaps: Stamps, following: NDArray[np.float64], edges: Stamps) -> Uneven:
        """Count the frames that are missing in gaps whose following gap is known (inf: there is none)."""
        none = np.empty((0, 2), np.int64)
        if not gaps.size:
            return Uneven(none, none)
        spans = np.stack((edges[:-1], edges[1:]), axis=1)
        short = gaps < self._short_ns
        early = spans[short] if short.any() else none
        # nearly always no gap is long
        if gaps.max() <= min(self._long_ns, np.nextafter(self._hiding_ns, 0)):
            return Uneven(none, early)
        caught_up = (following >= 0) & (following < self._short_ns)
        until = gaps + np.where(caught_up, following, 0.0)
        skipped = np.rint(until / self._period_ns) - np.where(caught_up, 2, 1)
        missing = np.where(gaps >= self._hiding_ns, skipped, 0)
        self._missing += int(missing.sum())
        return Uneven(spans[(gaps > self._long_ns) | (missing > 0)], early)
