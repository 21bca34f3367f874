"""Measures how much processor time the host gave to a process: without that, lateness says nothing about the software.

Sources: proc(5), /proc/stat (steal: time a hypervisor gave to others) and
/proc/PID/schedstat (Documentation/scheduler/sched-stats.rst: time on the CPU, time waiting for one, ns).
"""

import os
import selectors
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from bus.closing import Closing

STEAL = 7  # field of the cpu line after its name: user nice system idle iowait irq softirq steal
LEAST_WAIT_NS = 1_000_000
"""Shorter waits [ns] occur in every period and excuse nothing."""
FIELDS = 8  # guest time is already part of user time


@dataclass(frozen=True, slots=True)
class HostClock:
    """Processor time of the whole machine since boot, in clock ticks."""

    total: int
    stolen: int

    @classmethod
    def read(cls, file: Path = Path("/proc/stat")) -> "HostClock":
        """Now."""
        fields = [int(word) for word in file.read_text().split("\n", 1)[0].split()[1 : FIELDS + 1]]
        return cls(sum(fields), fields[STEAL])

    def stolen_since(self, before: "HostClock") -> float:
        """Share of the machine's processor time that went to other guests since `before`, 0..1."""
        total = self.total - before.total
        return (self.stolen - before.stolen) / total if total > 0 else 0.0


def waited_ns(pid: int | None = None) -> int:
    """Time the process' main thread was ready to run and had no processor [ns]."""
    return int(Path(f"/proc/{pid or os.getpid()}/schedstat").read_text().split()[1])


class Sleeps(selectors.DefaultSelector):
    """The selector of an event loop; records the begin and end of the process' last sleep [ns]."""

    def __init__(self) -> None:
        super().__init__()
        self.last_ns = (0, 0)

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """As the base class; a call with timeout 0 is not recorded as a sleep."""
        if timeout is not None and timeout <= 0.0:
            return super().select(timeout)
        from_ns = time.monotonic_ns()
        ready = super().select(timeout)
        self.last_ns = (from_ns, time.monotonic_ns())
        return ready

    def woken_late_ns(self, due_ns: int) -> int:
        """How long after `due_ns` it woke from a sleep during which that time passed [ns]; 0 if it was awake then."""
        from_ns, until_ns = self.last_ns
        return max(until_ns - due_ns, 0) if from_ns < due_ns else 0


class OwnWaits(Closing):
    """Measures how long the host kept this process waiting between two looks: for a processor, or for its timer.

    A look costs about a microsecond, because the file stays open.
    """

    def __init__(
        self,
        report: Callable[[int, int, int], None],
        sleeps: Sleeps | None = None,
        file: Path = Path("/proc/self/schedstat"),
    ) -> None:
        """report: called with the times of two looks and the wait between them [ns], if that is LEAST_WAIT_NS or more.

        sleeps: of the process' event loop. A kernel without such a file reports nothing.
        """
        self._report, self._sleeps = report, sleeps
        self._fd = os.open(file, os.O_RDONLY | os.O_CLOEXEC) if file.exists() else -1
        self._seen_ns, self._waited_ns = time.monotonic_ns(), self._read() if self._fd >= 0 else 0

    def _read(self) -> int:
        return int(os.pread(self._fd, 64, 0).split()[1])

    def look(self, now_ns: int, due_ns: int | None = None) -> None:
        """Once per tick or round, at its end; stamps of the monotonic clock. due_ns: of the tick."""
        if self._fd < 0:
            return
        waited_ns = self._read()
        kept_ns = waited_ns - self._waited_ns
        # A process that sleeps when its tick is due does nothing that could make it late: the time until it wakes is
        # the host's. schedstat does not count it when the whole virtual machine stood still.
        if self._sleeps is not None and due_ns is not None:
            kept_ns = max(kept_ns, self._sleeps.woken_late_ns(due_ns))
        if kept_ns >= LEAST_WAIT_NS:
            self._report(self._seen_ns, now_ns, kept_ns)
        self._seen_ns, self._waited_ns = now_ns, waited_ns

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1
