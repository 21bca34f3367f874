"""How busy the host was while a benchmark ran, and whether its figures mean something."""

import os
import resource
import time
from dataclasses import dataclass
from pathlib import Path

# Of the processors' time, by which a time by the wall clock may be too long. The ranges that are printed beside the medians are as wide. The
# timing verdicts of the bench allow 1 % (docs/howto/keep-time.md): there a single moment without a processor is a late cycle.
MOST_STOLEN = 0.03
MOST_FOREIGN = 0.10  # processors that others may use: a twentieth of a machine with two


@dataclass(frozen=True, slots=True)
class Host:
    """Processor time since boot [s], of all processors together."""

    at_s: float
    busy_s: float
    stolen_s: float
    own_s: float  # of this process and of its children that have ended

    @classmethod
    def now(cls) -> "Host":
        ticks = [int(word) for word in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:9]]
        user, nice, system, _, _, irq, softirq, steal = (t / os.sysconf("SC_CLK_TCK") for t in ticks)
        # benchmarks run as children: their time counts as our own once they have ended
        used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        own = sum(u.ru_utime + u.ru_stime for u in used)
        return cls(time.monotonic(), user + nice + system + irq + softirq, steal, own)


@dataclass(frozen=True, slots=True)
class Load:
    """What the host did during one benchmark."""

    name: str
    seconds: float
    foreign: float  # processors used by others, mean
    stolen: float  # share of the processors' time that the host took away
    disturbed: int = 0  # runs before this one that did not count

    @classmethod
    def between(cls, name: str, one: Host, two: Host) -> "Load":
        seconds = max(two.at_s - one.at_s, 1e-9)
        # what is left is work of others, whoever they are
        foreign = (two.busy_s - one.busy_s) - (two.own_s - one.own_s)
        # steal is counted per processor; the share is of all of them
        stolen = (two.stolen_s - one.stolen_s) / seconds / (os.cpu_count() or 1)
        return cls(name, seconds, max(foreign, 0.0) / seconds, stolen)

    @property
    def reasons(self) -> list[str]:
        """Why figures measured under this load are not published; none if they are."""
        found = []
        if self.foreign > MOST_FOREIGN:
            found.append(
                f"{self.name}: others used {self.foreign:.2f} processors (at most {MOST_FOREIGN:.2f})"
            )
        if self.stolen > MOST_STOLEN:
            found.append(
                f"{self.name}: the host took {self.stolen:.1%} of the time away (at most {MOST_STOLEN:.0%})"
            )
        return found
