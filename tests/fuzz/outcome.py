"""What a number of cases came to, and the measuring of time and memory of each."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

LONGEST_S = 10.0
MOST_MIB = 1024

Case = Callable[[int], tuple[int, int]]
"""Carries out the case of a number; returns how many units (files, frames) it had and how many were accepted. An exception is a defect."""


@dataclass(slots=True)
class Outcome:
    """What a number of cases came to."""

    units: int = 0
    """Files, or frames."""
    accepted: int = 0
    """Of those: read at least in part, or passed on."""
    took_s: float = 0.0
    slowest_s: float = 0.0
    peak_mib: float = 0.0
    """Largest growth of the process's resident memory."""
    defects: list[tuple[int, str]] = field(default_factory=list)
    """Number of the case, and what went wrong."""

    def add(self, other: "Outcome") -> None:
        """Take in what other cases came to."""
        self.units += other.units
        self.accepted += other.accepted
        self.took_s += other.took_s
        self.slowest_s = max(self.slowest_s, other.slowest_s)
        self.peak_mib = max(self.peak_mib, other.peak_mib)
        self.defects += other.defects


def carried_out(case: Case, first: int, count: int, begin: Callable[[int], None] = lambda _: None) -> Outcome:
    """The cases numbered from `first`. begin: called with the number of each before it starts."""
    outcome = Outcome()
    held_mib = _memory_mib("VmRSS")  # what this process has loaded before
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # the peak counts from here, proc(5)
    for number in range(first, first + count):
        begin(number)
        begun = time.perf_counter()
        try:
            units, accepted = case(number)
        except Exception as error:
            units, accepted = 1, 0
            outcome.defects.append((number, f"{type(error).__name__}: {error}"[:300]))
        took_s = time.perf_counter() - begun
        if took_s > LONGEST_S:
            outcome.defects.append((number, f"took {took_s:.1f} s"))
        outcome.add(Outcome(units, accepted, took_s, took_s))
    outcome.peak_mib = max(_memory_mib("VmHWM") - held_mib, 0.0)
    if outcome.peak_mib > MOST_MIB:
        outcome.defects.append((first, f"{outcome.peak_mib:.0f} MiB in one of {count} cases from here"))
    return outcome


def _memory_mib(field: str) -> float:
    """A field of this process's memory in /proc/self/status, in MiB."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    (found,) = (line for line in lines if line.startswith(f"{field}:"))
    return int(found.split()[1]) / 1024
