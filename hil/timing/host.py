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

CLOCK_TICK_NS = 1_000_000_000 // os.sysconf("SC_CLK_TCK")
IDLE = slice(3, 5)  # idle and iowait
STEAL = 7  # field of the cpu line after its name: user nice system idle iowait irq softirq steal
LEAST_WAIT_NS = 1_000_000
"""Shorter waits [ns] occur in every period and excuse nothing."""
LATE_NS = 4_000_000
"""A tick that ends so long [ns] after it was due may have been kept by the hypervisor; a usual one takes a millisecond."""
FRESH_NS = 100_000_000
"""Age [ns] up to which a reading of the stolen time stands for the time before a late tick."""
FIELDS = 8  # guest time is already part of user time


@dataclass(frozen=True, slots=True)
class HostClock:
    """Processor time of the whole machine since boot, in clock ticks."""

    total: int
    stolen: int
    busy: int = 0  # not idle, nor waiting for a disk

    @classmethod
    def read(cls, file: Path = Path("/proc/stat")) -> "HostClock":
        """Now."""
        fields = [int(word) for word in file.read_text().split("\n", 1)[0].split()[1 : FIELDS + 1]]
        return cls(sum(fields), fields[STEAL], sum(fields) - sum(fields[IDLE]))

    def stolen_since(self, before: "HostClock") -> float:
        """Share of the machine's processor time that went to other guests since `before`, 0..1."""
        return (self.stolen - before.stolen) / max(self.total - before.total, 1)

    def busy_since(self, before: "HostClock") -> float:
        """Share of the machine's processor time in which a processor was not idle since `before`, 0..1."""
        return (self.busy - before.busy) / max(self.total - before.total, 1)


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
        host: Path = Path("/proc/stat"),
    ) -> None:
        """report: called with the times of two looks and the wait between them [ns], if that is LEAST_WAIT_NS or more.

        sleeps: of the process' event loop. A kernel without such a file reports nothing. host: the file with the stolen time.
        """
        self._report, self._sleeps, self._host = report, sleeps, host
        self._stolen, self._stolen_ns = 0, -FRESH_NS  # read at the first look
        self._late: tuple[int, int, int] | None = None
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
        if due_ns is not None:
            self._report_stolen(now_ns)
        if kept_ns >= LEAST_WAIT_NS:
            self._report(self._seen_ns, now_ns, kept_ns)
        elif due_ns is not None and now_ns - due_ns >= LATE_NS:
            self._late = self._seen_ns, now_ns, now_ns - due_ns
        self._seen_ns, self._waited_ns = now_ns, waited_ns

    def _report_stolen(self, now_ns: int) -> None:
        """Report the tick before this one if it was late for no other reason and the hypervisor took time meanwhile.

        A process that computes while its virtual machine stands still neither waits nor sleeps. The kernel counts stolen time
        some milliseconds later, hence one look later.
        """
        if self._late is None and now_ns - self._stolen_ns < FRESH_NS:
            return
        stolen = HostClock.read(self._host).stolen
        if self._late is not None and stolen > self._stolen:
            begin_ns, end_ns, late_ns = self._late
            self._report(begin_ns, end_ns, min((stolen - self._stolen) * CLOCK_TICK_NS, late_ns))
        self._stolen, self._stolen_ns, self._late = stolen, now_ns, None

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1
