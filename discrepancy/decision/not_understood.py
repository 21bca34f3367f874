"""What was set aside because nothing explains it: complaints with times, and what follows for the verdict."""

from discrepancy.estimation.problem import Problem
from discrepancy.estimation.set_aside import STEPS, OddInterval
from discrepancy.selection.state import State
from discrepancy.signals.quantities import span
from discrepancy.signals.recording import Complaint

SHOWN = 3  # times of single readings in a complaint


def complaints_of(problem: Problem, state: State) -> list[Complaint]:
    """One complaint for each interval, and one for all single readings of the same channels of a recording."""
    found: list[Complaint] = []
    single: dict[tuple[str, str], list[OddInterval]] = {}
    for interval in state.aside.intervals:
        where = (problem.windows[interval.window].recording, ", ".join(interval.channels))
        if not _long(interval):
            single.setdefault(where, []).append(interval)
            continue
        text = f"is not understood from {span(interval.start_s, interval.end_s)}: the error is {interval.size:.2g} times that of the rest; set aside"
        found.append(Complaint(*where, text))
    for where, readings in single.items():
        times = ", ".join(f"{reading.start_s:.4g}" for reading in readings[:SHOWN])
        more = " s and others" if len(readings) > SHOWN else " s"
        count = sum(reading.rows for reading in readings)
        what = "single reading" if count == 1 else "single readings"
        text = f"has {count} {what} far off what anything explains, at {times}{more}; set aside"
        found.append(Complaint(*where, text))
    return found


def intervals_not_understood(problem: Problem, state: State) -> list[str]:
    """Reasons why a recording of which the rest is explained holds something that is missing."""
    return [
        f"{problem.windows[s.window].recording}: not understood from {span(s.start_s, s.end_s)}; the rest is judged without it"
        for s in state.aside.intervals
        if _long(s)
    ]


def _long(interval: OddInterval) -> bool:
    return interval.rows >= STEPS
