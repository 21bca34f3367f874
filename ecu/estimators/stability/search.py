"""The largest value that keeps a margin: a bracketed search that needs few evaluations and never leaves the safe side.

Regula falsi whose stale end is halved (Illinois). Its trial aims half a resolution beyond the root, so that the far end of the
bracket comes close as well. It is held so near to the middle that the bracket is at most `coarse` wide after so many
trials, whatever the margin's shape (the projection of the ITP method, Oliveira and Takahashi 2020).
"""

from typing import NamedTuple

from ecu.estimators.compiled import compiled


class Search(NamedTuple):
    """The limit lies from `low`, which keeps the margin, to `high`, which does not."""

    low: float
    high: float
    above: float  # margin left at `low`, 0 or more; halved while `high` alone moves
    below: float  # margin left at `high`, below 0; halved while `low` alone moves
    moved: float  # the end that moved last: +1 `low`, -1 `high`, 0 none yet
    kept: float  # margin left at `low`, never halved


@compiled
def over(high: float, above: float, below: float) -> Search:
    """The search between 0, where the margin left is `above`, and `high`, where it is `below`."""
    return Search(0.0, high, above, below, 0.0, above)


@compiled
def goes_on(s: Search, fine: float) -> bool:
    """Whether the limit is not known yet: `low` is further than half of `fine` from the root, by the line between both ends."""
    width = s.high - s.low
    return width > fine and width * s.kept > (s.kept - s.below) * fine / 2.0


@compiled
def next_trial(s: Search, left: int, fine: float, coarse: float) -> float:
    """Where to look next; left: trials left after this one; fine, coarse: widths that are good enough, and that are promised."""
    width, middle = s.high - s.low, (s.low + s.high) / 2.0
    # beyond the root by half a resolution: the other end of the bracket then follows
    aim = s.low + width * s.above / (s.above - s.below) + s.moved * fine / 2.0
    around = max(coarse * 2.0**left - width / 2.0, 0.0)
    aim = min(max(aim, middle - around), middle + around)
    return min(max(aim, s.low + fine / 2.0), s.high - fine / 2.0)


@compiled
def narrowed(s: Search, trial: float, margin: float) -> Search:
    """The search after the margin left at `trial` is known."""
    if margin >= 0.0:
        return Search(trial, s.high, margin, s.below / 2.0 if s.moved > 0.0 else s.below, 1.0, margin)
    return Search(s.low, trial, s.above / 2.0 if s.moved < 0.0 else s.above, margin, -1.0, s.kept)
