"""How much of the processor the host gave us: without it, lateness says nothing about the software.

Sources: proc(5), /proc/stat (steal: time a hypervisor gave to others) and
/proc/PID/schedstat (Documentation/scheduler/sched-stats.rst: time on the CPU, time waiting for one, ns).
"""

import os
from dataclasses import dataclass
from pathlib import Path

STEAL = 7  # field of the cpu line after its name: user nice system idle iowait irq softirq steal
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
