"""Memory of the processes of a real-time run, and the time that they waited for a processor.

Read from /proc once a second, from when a process is ready: loading and compiling are not measured. A process that was
killed and started again has two lives. The last second of a life is not in it, because only samples before its end
exist. The first MINUTE of a life fills buffers of fixed size; memory that grows after it grows for ever.

Sources: proc(5): /proc/PID/statm (resident pages), /proc/PID/task/TID/children; /proc/PID/schedstat, see `hil.timing.host`.
"""

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from hil.timing.host import HostClock, waited_ns
from hil.verdict import Result, Verdict

SAMPLE_S = 1.0
MINUTE_S = 60.0
OBSERVED_S = 120.0
"""Shortest life that is judged [s]: a minute to fill buffers, another one to show growth."""
GROWTH_BYTES = 1 << 20
"""Permitted after the first minute. 100 ticks/s over nine more minutes: 19 bytes each, less than one Python number."""
QUESTION = "memory of every process flat after its first minute"


@dataclass(frozen=True, slots=True)
class Reading:
    """One sample of one process."""

    resident: int  # memory [bytes]
    waited_ns: int  # time ready to run without a processor, since its start


@dataclass(frozen=True, slots=True, kw_only=True)
class Life:
    """One process from its first to its last sample."""

    process: str
    pid: int
    seconds: float  # [s]
    start_bytes: int
    settled_bytes: int | None  # memory after the first minute; None in a shorter life
    end_bytes: int
    largest_bytes: int  # after the first minute
    waited: float  # share of the time ready to run without a processor, 0 to 1
    worst_waited: float  # the same in the worst second

    @property
    def growth_bytes(self) -> int | None:
        """Largest memory after the first minute minus the memory then [bytes]; None for a life too short to judge."""
        if self.settled_bytes is None or self.seconds < OBSERVED_S:
            return None
        return self.largest_bytes - self.settled_bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Vitals:
    """The state of host and processes over one run."""

    stolen: float  # share of the machine's processor time given to other guests, 0 to 1
    worst_stolen: float  # the same in the worst second
    lives: tuple[Life, ...]
    most_busy: float = 0.0  # share of the processors' time that was not idle, in the busiest second


def read(pid: int) -> Reading | None:
    """The process as it is now; None when it is gone."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
        waited = waited_ns(pid)
    except (OSError, IndexError):
        return None
    if not pages:
        return None  # a zombie: ended, but its parent has not waited for it yet
    return Reading(pages * os.sysconf("SC_PAGE_SIZE"), waited)


def with_children(processes: Iterable[tuple[str, int]]) -> list[tuple[str, int]]:
    """The processes, and their own children as NAME/child."""
    found = []
    for name, pid in processes:
        found.append((name, pid))
        try:
            children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        except OSError:
            continue
        found += [(f"{name}/child", int(child)) for child in children]
    return found


class _Watched:
    """A life so far."""

    def __init__(self, process: str, pid: int, first: Reading, now_ns: int) -> None:
        self._process, self._pid = process, pid
        self._first, self._first_ns = first, now_ns
        self._last, self._last_ns = first, now_ns
        self._settled: int | None = None
        self._largest = first.resident
        self._worst = 0.0

    def take(self, reading: Reading, now_ns: int) -> None:
        waited = (reading.waited_ns - self._last.waited_ns) / max(now_ns - self._last_ns, 1)
        self._worst = max(self._worst, waited)
        if self._settled is None:
            self._largest = reading.resident
            if now_ns - self._first_ns >= MINUTE_S * 1e9:
                self._settled = reading.resident
        self._largest = max(self._largest, reading.resident)
        self._last, self._last_ns = reading, now_ns

    def life(self) -> Life:
        elapsed_ns = self._last_ns - self._first_ns
        return Life(
            process=self._process,
            pid=self._pid,
            seconds=elapsed_ns * 1e-9,
            start_bytes=self._first.resident,
            settled_bytes=self._settled,
            end_bytes=self._last.resident,
            largest_bytes=self._largest,
            waited=(self._last.waited_ns - self._first.waited_ns) / max(elapsed_ns, 1),
            worst_waited=self._worst,
        )


class Watch:
    """Collects the samples of a run in a few numbers per process, however long the run lasts."""

    def __init__(
        self,
        read: Callable[[int], Reading | None] = read,
        read_host: Callable[[], HostClock] = HostClock.read,
    ) -> None:
        self._read, self._read_host = read, read_host
        self._watched: dict[tuple[str, int], _Watched] = {}
        self._host_first = self._host_last = read_host()
        self._worst_stolen = self._most_busy = 0.0

    def sample(self, processes: Iterable[tuple[str, int]], now_ns: int) -> None:
        """Sample the processes (name, pid) that are ready; now_ns: monotonic clock."""
        for name, pid in processes:
            reading = self._read(pid)
            if reading is None:
                continue
            if (name, pid) in self._watched:
                self._watched[name, pid].take(reading, now_ns)
            else:
                self._watched[name, pid] = _Watched(name, pid, reading, now_ns)
        host = self._read_host()
        self._worst_stolen = max(self._worst_stolen, host.stolen_since(self._host_last))
        self._most_busy = max(self._most_busy, host.busy_since(self._host_last))
        self._host_last = host

    def vitals(self) -> Vitals:
        """Of all samples."""
        return Vitals(
            stolen=self._host_last.stolen_since(self._host_first),
            worst_stolen=self._worst_stolen,
            lives=tuple(watched.life() for watched in self._watched.values()),
            most_busy=self._most_busy,
        )


def judge_memory(lives: Sequence[Life]) -> Verdict:
    """Whether no process grew after its first minute; inconclusive if a process did not live long enough."""
    grown = [life for life in lives if (growth := life.growth_bytes) is not None and growth > GROWTH_BYTES]
    if grown:
        return Verdict(question=QUESTION, result=Result.FAILED, reason="; ".join(map(_grew, grown)))
    known = {life.process for life in lives if life.growth_bytes is not None}
    short = [name for name in dict.fromkeys(life.process for life in lives) if name not in known]
    if short or not lives:
        reason = f"observed for less than {OBSERVED_S:.0f} s: {', '.join(short) or 'every process'}"
        return Verdict(question=QUESTION, result=Result.INCONCLUSIVE, reason=reason)
    most = max(life.growth_bytes or 0 for life in lives)
    reason = f"{len(known)} processes, none more than {most / 1024:.0f} KiB above it, permitted {GROWTH_BYTES / 1024:.0f} KiB"
    return Verdict(question=QUESTION, result=Result.PASSED, reason=reason)


def _grew(life: Life) -> str:
    grown = (life.growth_bytes or 0) / 1024
    return f"{life.process} grew by {grown:.0f} KiB in {life.seconds - MINUTE_S:.0f} s, permitted {GROWTH_BYTES / 1024:.0f} KiB"
