"""What was set aside because nothing explains it: complaints with times, and what follows for the verdict."""

from discrepancy.estimation.problem import Problem
from discrepancy.estimation.set_aside import STEPS, Stretch
from discrepancy.selection.state import State
from discrepancy.signals.recording import Complaint

SHOWN = 3  # times of single readings in a complaint


def complaints_of(problem: Problem, state: State) -> list[Complaint]:
    """One complaint for each stretch of time, and one for all single readings of the same channels of a recording."""
    found: list[Complaint] = []
    single: dict[tuple[str, str], list[Stretch]] = {}
    for stretch in state.aside.stretches:
        where = (problem.windows[stretch.window].recording, ", ".join(stretch.channels))
        if not _long(stretch):
            single.setdefault(where, []).append(stretch)
            continue
        text = f"is not understood from {_span(stretch)}: the error is {stretch.size:.2g} times that of the rest; set aside"
        found.append(Complaint(*where, text))
    for where, readings in single.items():
        times = ", ".join(f"{reading.start_s:.4g}" for reading in readings[:SHOWN])
        more = " s and others" if len(readings) > SHOWN else " s"
        count = sum(reading.rows for reading in readings)
        text = f"has {count} single readings far off what anything explains, at {times}{more}; set aside"
        found.append(Complaint(*where, text))
    return found


def stretches_not_understood(problem: Problem, state: State) -> list[str]:
    """Reasons why a recording of which the rest is explained holds something that is missing."""
    return [
        f"{problem.windows[s.window].recording}: not understood from {_span(s)}; the rest is judged without it"
        for s in state.aside.stretches
        if _long(s)
    ]


def _long(stretch: Stretch) -> bool:
    return stretch.rows >= STEPS


def _span(stretch: Stretch) -> str:
    return f"{stretch.start_s:.4g} to {stretch.end_s:.4g} s"
