"""Counts the steps of one message's alive counter: repeated frames, jumps, and frames lost in between. Pure."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(slots=True)
class CounterSteps:
    """Takes stamps and counters of a message in the order of arrival.

    A counter gives a step only modulo its number of values; the time between the frames selects among the candidates.
    """

    period_ns: int
    modulus: int  # number of values of the counter
    duplicates: int = 0
    jumps: int = 0
    errors: int = (
        0  # of the jumps, those that a pause of the sender for a turn of the counter cannot look like
    )
    lost: int = 0  # frames between sender and us
    _last: tuple[int, int] | None = None  # stamp and counter of the last frame

    def add(
        self, at_ns: NDArray[np.int64], counters: NDArray[np.int64], same: NDArray[np.bool_] | None
    ) -> None:
        """Count the steps up to these frames. same: whether each has the payload of the one before it; None: not known."""
        if not at_ns.size:
            return
        if self._last is None:
            same = None if same is None else same[1:]
        else:
            at_ns = np.concatenate((np.array([self._last[0]]), at_ns))
            counters = np.concatenate((np.array([self._last[1]]), counters))
        self._last = int(at_ns[-1]), int(counters[-1])
        modulo = np.diff(counters) % self.modulus
        outside = (counters < 0) | (counters >= self.modulus)
        periods = np.diff(at_ns) / self.period_ns
        # nearly always every counter follows the one before it, within half a turn
        if (modulo == 1).all() and not outside.any() and periods.max(initial=0) < self.modulus / 2:
            return
        turns = np.maximum(np.rint((periods - modulo) / self.modulus), 0)
        step = (modulo + self.modulus * turns).astype(np.int64)
        still = step == 0
        duplicate = still if same is None else still & same
        jump = (step > 1) | (still & ~duplicate) | outside[1:]
        # one step in a gap of fifteen periods: fifteen frames were lost, or the sender paused and none was sent
        paused = (modulo == 1) & ~outside[1:]
        self.duplicates += int(duplicate.sum())
        self.jumps += int(jump.sum())
        self.errors += int((jump & ~paused).sum())
        self.lost += int((step[step > 1] - 1).sum())
