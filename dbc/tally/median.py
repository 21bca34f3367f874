"""The median of any number of integers, in memory that does not grow with them. Pure.

Each different value is kept once, with its count. When there are more than DISTINCT of them, neighbours are put together:
the bins become twice as wide. The median is exact until then, and lies within half a bin of the exact one afterwards.
"""

import numpy as np
from numpy.typing import NDArray

DISTINCT = 1 << 16
"""Different values that are kept. Gaps with the microseconds of a log are not as many unless they scatter by 65 ms."""
WAITING = 1 << 12
"""Values that wait for being counted: sorting some thousands at once costs less per value than a few."""


class RunningMedian:
    """Takes integers, gives their median."""

    def __init__(self, distinct: int = DISTINCT) -> None:
        self._distinct = distinct
        self._waiting: list[NDArray[np.int64]] = []
        self._size = 0
        self._bins, self._counts = np.empty((2, 0), np.int64)
        self.shift = 0  # a bin holds 2**shift values

    def add(self, values: NDArray[np.int64]) -> None:
        """Take some more."""
        self._waiting.append(values)
        self._size += values.size
        if self._size >= WAITING:
            self._sort_in()

    def value(self) -> float | None:
        """The median of all so far; None without any."""
        self._sort_in()
        if not self._bins.size:
            return None
        reached = np.cumsum(self._counts)
        total = int(reached[-1])
        # of an even number of values the mean of the two in the middle
        middle = np.searchsorted(reached, [(total - 1) // 2, total // 2], side="right")
        low, high = (int(value) for value in self._bins[middle])
        half_a_bin = ((1 << self.shift) - 1) / 2
        return (low + high) * (1 << self.shift) / 2 + half_a_bin

    def _sort_in(self) -> None:
        if not self._waiting:
            return
        values = np.concatenate(self._waiting) >> self.shift
        self._waiting, self._size = [], 0
        bins, counts = np.unique(values, return_counts=True)
        self._regroup(np.concatenate((self._bins, bins)), np.concatenate((self._counts, counts)))
        while self._bins.size > self._distinct:
            self.shift += 1
            self._regroup(self._bins >> 1, self._counts)

    def _regroup(self, bins: NDArray[np.int64], counts: NDArray[np.int64]) -> None:
        """Put equal bins together."""
        self._bins, places = np.unique(bins, return_inverse=True)
        self._counts = np.zeros(self._bins.size, np.int64)
        np.add.at(self._counts, places, counts)
