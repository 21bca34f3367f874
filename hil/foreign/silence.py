"""Finds the silences of a node from the stamps of its frames, for `attend` and for the verdict after the run. Pure."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from dbc.database import Database
from hil.verdict import Result, Verdict

SILENT_NS: Final = 100_000_000  # without any frame: ten cycles of the fastest messages of loader.dbc


@dataclass(frozen=True, slots=True)
class Silence:
    """An interval without frames of a node, on the clock of the run."""

    from_s: float  # last frame before it [s]
    until_s: float  # first frame after it, or the end of what was observed [s]
    ended: bool = True  # whether a frame ended it; False: silent when the observation ended

    @property
    def lasts_s(self) -> float:
        """How long it lasts [s]; at least this, if no frame ended it."""
        return self.until_s - self.from_s

    def __str__(self) -> str:
        return f"{self.from_s:.2f} s " + (f"to {self.until_s:.2f} s" if self.ended else "on")


def silences(time_s: ArrayLike, *, end_s: float, silent_s: float = SILENT_NS * 1e-9) -> list[Silence]:
    """The silences of a node between time zero and `end_s`, from the times of all its frames [s]."""
    times = np.sort(np.asarray(time_s, float))
    # begin and end of the run count as frames: a node that starts late or stops early is silent there
    inside = np.concatenate(([0.0], times[(times >= 0) & (times <= end_s)], [end_s]))
    gaps = np.flatnonzero(np.diff(inside) > silent_s)
    ends = zip(inside[gaps].tolist(), inside[gaps + 1].tolist(), gaps < inside.size - 2, strict=True)
    return [Silence(begin, end, bool(ended)) for begin, end, ended in ends]


def judge_presence(node: str, time_s: ArrayLike, *, end_s: float, host_s: float = 0.0) -> Verdict:
    """Whether a foreign node was there throughout the run.

    host_s: how long the host may have kept the node waiting [s], if it is a process of the bench's own computer. Silences that
    this explains are inconclusive, and so is one that had lasted no longer than that when the run ended.
    """
    times, permitted_s = np.asarray(time_s, float), SILENT_NS * 1e-9 + host_s
    found = silences(times, end_s=end_s)
    shown = ", ".join(map(str, found[:3])) + (f" and {len(found) - 3} times more" if len(found) > 3 else "")
    result, reason = Result.FAILED, f"silent from {shown}"
    if end_s <= 0:
        result, reason = Result.INCONCLUSIVE, "nothing was recorded"
    elif not found:
        frames = ((times >= 0) & (times <= end_s)).sum()
        result, reason = Result.PASSED, f"{frames} frames, never silent for 100 ms"
    elif all(each.lasts_s <= permitted_s for each in found):
        result = Result.INCONCLUSIVE
        reason += f"; the host may have kept processes of this computer waiting for up to {host_s:.2f} s"
    return Verdict(question=f"{node} is there throughout", result=result, reason=reason)


def identifiers_of(node: str, database: Database) -> frozenset[int]:
    """The `can_id` words of the messages that a node sends."""
    return frozenset(codec.can_id for codec in database.by_name.values() if node in codec.senders)
