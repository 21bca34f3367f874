"""Waits of processes for a processor, and whether one of them explains a delay. Pure.

Each process reads its own waiting time once per tick or round (`hil.timing.host.OwnWaits`). A row is one reading: the time
of the reading before, the time of this one, and the wait in between [ns].
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.int64]
"""(n, 3) in the order of time: from, until, waited [ns]."""


@dataclass(frozen=True, slots=True)
class Wait:
    """One wait of one process for a processor."""

    process: str
    waited_ns: int
    until_ns: int  # time of the reading that shows it

    def describe(self, zero_ns: int) -> str:
        """The wait as text. zero_ns: begin of the run's time."""
        at_s = (self.until_ns - zero_ns) * 1e-9
        return f"{self.process} was kept waiting {self.waited_ns * 1e-6:.1f} ms at {at_s:.2f} s"


def explaining(
    waits: Mapping[str, Rows], from_ns: int, until_ns: int, needed_ns: int, *, beyond_ns: int | None = None
) -> Wait | None:
    """The longest wait of which at least `needed_ns` can lie between the two times; None if there is none.

    waits: by process. beyond_ns: the wait must not have ended before this time.
    """
    found = []
    for process, rows in waits.items():
        first = int(np.searchsorted(rows[:, 1], from_ns if beyond_ns is None else beyond_ns, side="right"))
        last = int(np.searchsorted(rows[:, 0], until_ns, side="left"))
        near = rows[first:last]
        within = np.minimum(near[:, 1], until_ns) - np.maximum(near[:, 0], from_ns)
        # The place of a wait between two readings is not known, so it counts as far as it can lie in the interval. Waits of
        # several readings or processes are not added up: many small ones are the normal load of the host.
        enough = near[np.minimum(near[:, 2], within) >= needed_ns]
        if enough.size:
            _, seen_ns, waited_ns = enough[np.argmax(enough[:, 2])].tolist()
            found.append(Wait(process, waited_ns, seen_ns))
    return longest(found)


def longest_of(waits: Mapping[str, Rows]) -> Wait | None:
    """The longest wait of all processes; None if there is none."""
    rows = [(name, of[np.argmax(of[:, 2])].tolist()) for name, of in waits.items() if of.size]
    return longest([Wait(name, row[2], row[1]) for name, row in rows])


def longest(waits: Iterable[Wait]) -> Wait | None:
    """The longest of the given waits; None if there is none."""
    return max(waits, key=lambda wait: wait.waited_ns, default=None)
