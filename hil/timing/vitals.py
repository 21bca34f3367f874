"""Memory of the processes of a real-time run, and the time that they waited for a processor.

Read from /proc once a second, from when a process is ready: what it loads and compiles before belongs to no
period. A process that was killed and started again has two lives. Only the last sample before its end
is known, so the last second of a life is not in it. The first MINUTE of a life fills buffers of fixed size; what grows after it grows for ever.

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
"""A shorter life says nothing about growth: a minute to settle, another to grow."""
GROWTH_BYTES = 1 << 20
"""Permitted after the first minute. 100 ticks/s over nine more minutes: 19 bytes each, less than one Python number."""
QUESTION = "memory of every process flat after its first minute"


@dataclass(frozen=True, slots=True)
class Reading:
    """Of one process at one moment: resident memory [bytes], time it has waited for a processor [ns]."""

    resident: int
    waited_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Life:
    """One process from its first to its last sample.

    Memory [bytes]: settled_bytes after the first minute, None in a shorter life; largest_bytes from then on.
    waited, worst_waited: share of the time ready to run without a processor, of the life and of its worst second.
    """

    process: str
    pid: int
    seconds: float
    start_bytes: int
    settled_bytes: int | None
    end_bytes: int
    largest_bytes: int
    waited: float
    worst_waited: float

    @property
    def growth_bytes(self) -> int | None:
        """The most it held after its first minute, above what it held then; None for a life too short to judge."""
        if self.settled_bytes is None or self.seconds < OBSERVED_S:
            return None
        return self.largest_bytes - self.settled_bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Vitals:
    """stolen, worst_stolen: share of the machine's processor time given to other guests, and in the worst second."""

    stolen: float
    worst_stolen: float
    lives: tuple[Life, ...]


def read(pid: int) -> Reading | None:
    """The process as it is now; None when it is gone."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
        waited = waited_ns(pid)
    except (OSError, IndexError):
        return None
    if not pages:
        return None  # dead, but its parent has not looked
    return Reading(pages * os.sysconf("SC_PAGE_SIZE"), waited)


def with_children(processes: Iterable[tuple[str, int]]) -> list[tuple[str, int]]:
    """The processes, and those that they started themselves as NAME/child."""
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
    """Keeps what the samples of a run say; a few numbers per process, however long the run."""

    def __init__(
        self,
        read: Callable[[int], Reading | None] = read,
        read_host: Callable[[], HostClock] = HostClock.read,
    ) -> None:
        self._read, self._read_host = read, read_host
        self._watched: dict[tuple[str, int], _Watched] = {}
        self._host_first = self._host_last = read_host()
        self._worst_stolen = 0.0

    def sample(self, processes: Iterable[tuple[str, int]], now_ns: int) -> None:
        """Look at the processes (name, pid) that are ready; a stamp of the monotonic clock."""
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
        self._host_last = host

    def vitals(self) -> Vitals:
        """Of all samples."""
        return Vitals(
            stolen=self._host_last.stolen_since(self._host_first),
            worst_stolen=self._worst_stolen,
            lives=tuple(watched.life() for watched in self._watched.values()),
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
