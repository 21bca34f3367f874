"""From the kernel's wall-clock stamps to the monotonic clock that everything else uses.

Their difference is a constant of the kernel until somebody sets the clock: NTP slews
both alike. It is measured once and again after a jump.
"""

import time

# Below a millisecond a set clock and an interrupted reading cannot be distinguished.
JUMP_NS = 1_000_000
# How long a frame may be on its way between its stamp and the queue of a socket on a starved machine.
_IN_FLIGHT_NS = 1_000_000_000
_READINGS = 32


class WallClock:
    """The difference between CLOCK_REALTIME and CLOCK_MONOTONIC [ns]."""

    def __init__(self) -> None:
        self.ahead_ns = measure()
        self.set_ns: int | None = None
        """When the clock was last found set, in monotonic time; None: never."""

    def monotonic_ns(self, wall_ns: int) -> int:
        """The monotonic time of a wall-clock time."""
        return wall_ns - self.ahead_ns

    def check(self) -> None:
        """Measure again if the clock has been set by more than a millisecond."""
        if self._off(time.time_ns() - time.monotonic_ns()):
            measured = measure()
            # the quick look may have been interrupted between its two readings; the careful one decides
            if self._off(measured):
                self.ahead_ns = measured
                self.set_ns = time.monotonic_ns()

    def set_since(self, since_ns: int) -> bool:
        """Whether the clock has been set since a moment, or up to a second before; looks once more."""
        self.check()
        return self.set_ns is not None and self.set_ns > since_ns - _IN_FLIGHT_NS

    def _off(self, ahead_ns: int) -> bool:
        return abs(ahead_ns - self.ahead_ns) > JUMP_NS


def measure() -> int:
    """The difference [ns]: of 32 readings of one clock between two of the other, the one with the least time between."""
    best_ns, ahead_ns = 1 << 62, 0
    for _ in range(_READINGS):
        before = time.monotonic_ns()
        wall = time.time_ns()
        after = time.monotonic_ns()
        if after - before < best_ns:
            best_ns, ahead_ns = after - before, wall - (before + after) // 2
    return ahead_ns


SHARED = WallClock()
"""One for the process, so that the stamps of its buses agree exactly."""
