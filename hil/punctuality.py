"""How a real-time run kept its times: every message on every bus, every task; as run.json holds it.

A fault that was injected may make frames late, and may hide that the bench was late by itself: with one
that struck frames, messages that were not in time decide nothing.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hil.deadlines import doubts_of
from hil.recording.check import QUESTION, Check, Judged, doubtful
from hil.timing import TaskVerdict
from hil.verdict import Result, Verdict

GRAVITY = (Result.PASSED, Result.INCONCLUSIVE, Result.FAILED)


@dataclass(frozen=True, slots=True, kw_only=True)
class Punctuality:
    """frames: the verdict on all messages; ticks: that on all tasks and the reaction."""

    frames: Verdict
    ticks: Verdict
    messages: tuple[Judged, ...]
    tasks: tuple[TaskVerdict, ...]


def all_frames(checks: Mapping[str, Check], unread: Sequence[str], struck: int) -> Verdict:
    """One verdict over the checks of several buses, by the name of each.

    unread: why a bus could not be read. struck: injected faults that struck frames.
    """
    doubts = dict.fromkeys(
        [*unread, *(doubt for check in checks.values() for doubt in doubts_of(check.observer))]
    )
    if doubts:
        return doubtful([message for check in checks.values() for message in check.messages], list(doubts))
    worst = max((check.overall.result for check in checks.values()), key=GRAVITY.index)
    told = [
        f"{bus}: {check.overall.reason}" if len(checks) > 1 else check.overall.reason
        for bus, check in checks.items()
        if check.overall.result is worst
    ]
    if worst is Result.FAILED and struck:
        worst = Result.INCONCLUSIVE
        told.insert(0, f"injected faults struck ({struck}) and may be why")
    return Verdict(question=QUESTION, result=worst, reason="; ".join(told))
