"""Reaction time seen from the machine: sensor frame out to Limits frame in.

Each sensor sample carries a sequence number; EcuStatus echoes the newest one its cycle consumed. The ECU
sends Limits and EcuStatus in the same cycle, so the Limits frame that came since the previous EcuStatus
belongs to the echo.
"""

from array import array
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SEQUENCES = 1 << 16


@dataclass(frozen=True, slots=True)
class Reactions:
    """One row per echo; stamps in integer nanoseconds of the monotonic clock."""

    sequence: NDArray[np.int64]
    sent_ns: NDArray[np.int64]  # the sensor frame handed to the bus
    limits_ns: NDArray[np.int64]  # the Limits frame of that ECU cycle received
    status_ns: NDArray[np.int64]  # its EcuStatus frame received


class ReactionStamps:
    """Matches echoes with the samples they answer. No clock in here."""

    def __init__(self) -> None:
        self._sent = [-1] * SEQUENCES
        self._limits_ns = -1
        self._rows = array("q")  # flat rows: compact over hours

    def sent(self, sequence: int, now_ns: int) -> None:
        """The sample `sequence` was handed to the bus."""
        self._sent[sequence % SEQUENCES] = now_ns

    def limits(self, at_ns: int) -> None:
        """A good Limits frame came."""
        self._limits_ns = at_ns

    def status(self, echo: int, at_ns: int) -> None:
        """A good EcuStatus frame came. An echo of a sample never sent, or without Limits, is no reaction."""
        sent_ns = self._sent[echo]
        if sent_ns >= 0 and self._limits_ns >= 0:
            self._rows.extend((echo, sent_ns, self._limits_ns, at_ns))
            self._sent[echo] = -1  # a repeated echo is not a second reaction
        self._limits_ns = -1

    def reactions(self) -> Reactions:
        """All reactions so far."""
        rows = np.array(self._rows, dtype=np.int64).reshape(-1, 4)
        return Reactions(rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3])
