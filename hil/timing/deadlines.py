"""Judges the timing of cyclic messages by the DBC's cycle times, for `check` and for the verdict of real-time runs.

Pure: stamps, counters and payloads in, verdicts out; the same for a running bus and for a recording.
The period T of a message is its GenMsgCycleTime. Between two frames of a message, with gap g:

- g > T (1 + tolerance): *late*, and where g >= 1.5 T, round(g/T) - 1 frames are *missing*; when the next frame is early,
  this one was delayed: then round((g + g')/T) - 2 over both gaps;
- g < T (1 - tolerance): *early*;
- the alive counter stands still: *duplicate*, when the payload is the same too, else a *counter jump*;
- the alive counter advances by n > 1: *counter jump*, n - 1 frames lost between sender and us.

The silence before the first and after the last frame counts like a gap: a message that stops is late.
A message is *stale* in every gap from `stale_after` periods on; the share of that time is reported. A NaN or a
stamp that runs backwards is a failure, never a pass.

A message is inconclusive, with the reason, when the DBC gives no period, when it was observed for less than three
periods, when the observer lost frames, or when the host did not give the observer its processor time. A late message is
inconclusive too when a single wait for a processor, of its sender or of a process on the path, covers the whole delay.
A busy host delays frames. It repeats none, and lets no counter jump but where the bench counted frames that it dropped:
such a message has failed on a busy host too.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from dbc.tally.counters import CounterSteps
from dbc.tally.gaps import Gaps, Uneven
from hil.timing.waits import Rows, Wait, explaining, longest
from hil.verdict import Result, Verdict

TOLERANCE = 0.5
"""Permitted deviation of a gap from the period, as a share of it. ISO 11783-3 and J1939 leave it open;
half a period is where the next frame would be nearer than this one."""
STALE_AFTER = 3.0
"""Periods without a frame after which its values must not be used."""
LEAST_PERIODS = 3
"""Shorter observations say nothing about a period."""
QUESTION = "every message in time"
MOMENTARILY = "the host was starved for a moment"
COUNTER_MODULUS = 15
"""AUTOSAR E2E profile 1 counts 0..14."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Observation:
    """The recorded frames of one message."""

    name: str
    period_ns: int | None  # cycle time; None: the DBC gives none
    at_ns: NDArray[np.int64]  # (n,) stamps in the order of arrival
    counters: NDArray[np.int64] | None = None  # (n,) alive counters; None for a message without one
    same_payload: NDArray[np.bool_] | None = (
        None  # (n,) whether a frame equals the one before it; None: not kept
    )
    sender: str = ""  # node of the DBC
    modulus: int = COUNTER_MODULUS  # number of values of the alive counter


@dataclass(frozen=True, slots=True, kw_only=True)
class Observer:
    """The judged window, and how far the observer itself can be trusted."""

    start_ns: int
    end_ns: int
    lost: int = 0  # frames that the observer knows it lost
    dropped: int = 0  # frames that the bench's own processes dropped on the way: a counter may jump by them
    starved: str = ""  # which processes the host gave too little time; '' if none
    starved_moment: str = ""  # the same in the worst second: it may explain a late frame
    unfinished: bool = False  # whether the run was cut off
    # node -> process -> waits for a processor, of the processes that its frames come from and pass
    waits: Mapping[str, Mapping[str, Rows]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class MessageVerdict:
    """How one message kept its period: counts of events, gaps, and the verdict."""

    name: str
    period_ns: int | None
    frames: int
    late: int = 0  # gaps longer than permitted
    early: int = 0  # gaps shorter than permitted
    missing: int = 0  # frames that did not come
    duplicates: int = 0
    counter_jumps: int = 0
    counter_errors: int = (
        0  # of these, the ones that a pause of the sender for a turn of the counter cannot look like
    )
    lost_frames: int = 0  # between sender and us, by the counter
    backwards: int = 0  # stamps that run backwards
    stale_share: float = 0.0  # of the judged time, 0 to 1
    median_gap_ns: float | None = None
    worst_gap_ns: int | None = None
    worst_at_ns: int | None = None  # stamp at which the longest gap begins
    result: Result
    reason: str

    @property
    def events(self) -> list[str]:
        """The events against the message as text, before doubts about the observer are considered."""
        counts = (
            (self.missing, "missing"),
            (self.late, "late"),
            (self.early, "early"),
            (self.duplicates, "repeated"),
            (self.counter_jumps, "counter jumps"),
            (self.backwards, "stamps run backwards"),
        )
        found = [f"{count} {what}" for count, what in counts if count]
        if found and self.period_ns and self.worst_gap_ns and self.worst_gap_ns > self.period_ns:
            found.append(f"longest gap {self.worst_gap_ns * 1e-6:.1f} ms of {self.period_ns * 1e-6:.0f} ms")
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """The verdict on one message of one channel."""

    channel: str
    sender: str  # the first that the DBC names
    verdict: MessageVerdict


class MessageJudge:
    """Judges one message by frames that it takes piece by piece, in the order of arrival."""

    def __init__(
        self,
        period_ns: int | None,
        *,
        modulus: int = COUNTER_MODULUS,
        waits: Mapping[str, Rows] | None = None,
        tolerance: float = TOLERANCE,
        stale_after: float = STALE_AFTER,
    ) -> None:
        """waits: by process, of the processes that the message's frames come from and pass."""
        self._period_ns = period_ns if period_ns is not None and period_ns > 0 else None
        period = self._period_ns or 1
        self._gaps = Gaps(period, tolerance=tolerance, stale_after=stale_after)
        self._steps = CounterSteps(period, modulus)
        self._excuse = _Excuse(period, tolerance, waits or {})

    def add(
        self,
        at_ns: NDArray[np.int64],
        counters: NDArray[np.int64] | None = None,
        same_payload: NDArray[np.bool_] | None = None,
    ) -> None:
        """Take some more frames; the arrays are those of an `Observation`."""
        self._excuse.add(self._gaps.add(at_ns))
        # without a counter, equal content cannot be distinguished from a repeated frame
        if counters is not None:
            self._steps.add(at_ns, counters, same_payload)

    def verdict(self, name: str, observer: Observer) -> MessageVerdict:
        """The verdict over the observer's window, which holds all frames. Nothing is added afterwards."""
        frames, period = self._gaps.frames, self._period_ns
        window = observer.end_ns - observer.start_ns
        reason = ""
        if period is None:
            reason = "the DBC gives no cycle time: nothing to judge it by"
        elif window < LEAST_PERIODS * period:
            wanted = f"{LEAST_PERIODS} periods of {period * 1e-6:.0f} ms"
            reason = f"observed for {window * 1e-6:.0f} ms, less than {wanted}"
        if reason:
            return MessageVerdict(
                name=name, period_ns=period, frames=frames, result=Result.INCONCLUSIVE, reason=reason
            )
        gaps, steps = self._gaps.finish(observer.start_ns, observer.end_ns), self._steps
        self._excuse.add(gaps.uneven)
        verdict = MessageVerdict(
            name=name,
            period_ns=period,
            frames=frames,
            late=gaps.late,
            early=gaps.early,
            missing=gaps.missing,
            duplicates=steps.duplicates,
            counter_jumps=steps.jumps,
            counter_errors=steps.errors,
            lost_frames=steps.lost,
            backwards=gaps.backwards,
            stale_share=gaps.stale_ns / window,
            median_gap_ns=gaps.median_ns,
            worst_gap_ns=gaps.longest_ns,
            worst_at_ns=gaps.longest_at_ns,
            result=Result.PASSED,
            reason="",
        )
        excusable = not (verdict.duplicates or verdict.counter_errors or verdict.backwards)
        return _concluded(verdict, observer, self._excuse.wait if excusable else None)


def judge_message(
    seen: Observation,
    observer: Observer,
    *,
    tolerance: float = TOLERANCE,
    stale_after: float = STALE_AFTER,
) -> MessageVerdict:
    """The verdict on one message over the observer's window."""
    judge = MessageJudge(
        seen.period_ns,
        modulus=seen.modulus,
        waits=observer.waits.get(seen.sender),
        tolerance=tolerance,
        stale_after=stale_after,
    )
    judge.add(seen.at_ns, seen.counters, seen.same_payload)
    return judge.verdict(seen.name, observer)


class _Excuse:
    """The longest wait for a processor, if each gap that is too long or too short is explained by one."""

    def __init__(self, period: int, tolerance: float, waits: Mapping[str, Rows]) -> None:
        self._period, self._waits = period, waits
        # beyond 1.5 periods a frame counts as missing, whatever the tolerance
        self._permitted = round(period * (1 + min(tolerance, 0.5)))
        self._least = round(period * (1 - tolerance))
        self._possible = bool(waits)
        self.wait: Wait | None = None

    def add(self, uneven: Uneven) -> None:
        """Look for a wait for each of these gaps."""
        for gaps, explain in ((uneven.late, self._late), (uneven.early, self._early)):
            # one gap without an explanation is enough: the others need not be looked at
            for begin, end in gaps.tolist() if self._possible else ():
                wait = explain(begin, end)
                if wait is None:
                    self._possible, self.wait = False, None
                    return
                self.wait = wait if self.wait is None else longest((self.wait, wait))

    def _late(self, begin: int, end: int) -> Wait | None:
        beyond = max(end - begin - self._permitted, 1)
        # A wait that ended before the frame was due delays it only if its sender skips ticks and continues its
        # schedule later: the wait is then as long as the whole delay.
        wait = explaining(self._waits, begin, end, beyond, beyond_ns=begin + self._period)
        return wait or explaining(self._waits, begin, end, end - begin - self._period)

    def _early(self, begin: int, end: int) -> Wait | None:
        return explaining(self._waits, end - self._period, begin, begin + self._least - end)


def _concluded(verdict: MessageVerdict, observer: Observer, excuse: Wait | None) -> MessageVerdict:
    """The verdict with its result: doubts about the observer first, then excuses for what was late."""
    events = verdict.events
    only_late = bool(events) and not beyond_lateness(verdict, observer)
    doubts = reasons_for_doubt(observer, late=only_late)
    if not doubts and only_late and (observer.starved_moment or excuse is not None):
        cause = observer.starved_moment or (excuse.describe(observer.start_ns) if excuse else "")
        result, reason = Result.INCONCLUSIVE, "; ".join([*events, f"{MOMENTARILY}: {cause}"])
    elif events and not doubts:
        result, reason = Result.FAILED, "; ".join(events)
    elif doubts:
        result, reason = Result.INCONCLUSIVE, "; ".join([*doubts, *events])
    else:
        result, reason = Result.PASSED, f"{verdict.frames} frames in time"
    return replace(verdict, result=result, reason=reason)


def beyond_lateness(verdict: MessageVerdict, observer: Observer) -> bool:
    """Whether something is wrong with the message that a busy host cannot cause: it delays frames, and does not repeat them."""
    return bool(verdict.duplicates or verdict.backwards or (verdict.counter_errors and not observer.dropped))


def only_late(judged: Iterable[Judged], observer: Observer) -> bool:
    """Whether a message was not in time, and nothing is wrong with any that a busy host cannot cause."""
    wrong = [one.verdict for one in judged if one.verdict.events]
    return bool(wrong) and not any(beyond_lateness(verdict, observer) for verdict in wrong)


def reasons_for_doubt(observer: Observer, *, late: bool) -> list[str]:
    """Reasons why this observer's findings decide nothing; [] if there are none.

    late: whether messages were late, and no more than that. A starved host can explain a late message, but cannot make one in time.
    """
    doubts = []
    if observer.lost:
        doubts.append(f"the observer itself lost {observer.lost} frames")
    if observer.starved and late:
        doubts.append(f"the host was starved: {observer.starved}")
    if observer.unfinished:
        doubts.append("the run was cut off before its end")
    return doubts


def overall(verdicts: Sequence[MessageVerdict], question: str = QUESTION) -> Verdict:
    """One verdict over all messages: failed if any failed, inconclusive if any could not be judged."""
    if not verdicts:
        return Verdict(question=question, result=Result.INCONCLUSIVE, reason="no message was judged")
    count = Counter(verdict.result for verdict in verdicts)
    for result in (Result.FAILED, Result.INCONCLUSIVE):
        if count[result]:
            named = [f"{v.name}: {v.reason}" for v in verdicts if v.result is result]
            more = f" (and {len(named) - 3} more)" if len(named) > 3 else ""
            return Verdict(question=question, result=result, reason="; ".join(named[:3]) + more)
    frames = sum(verdict.frames for verdict in verdicts)
    reason = f"{len(verdicts)} messages, {frames} frames, none late, early, missing or repeated"
    return Verdict(question=question, result=Result.PASSED, reason=reason)


def doubtful(judged: Sequence[Judged], doubts: Sequence[str]) -> Verdict:
    """The inconclusive verdict of a doubtful observer, with its findings for information."""
    suspect = sum(1 for one in judged if one.verdict.events)
    found = f"{suspect} of {len(judged)} messages not in time" if suspect else "nothing found late"
    return Verdict(question=QUESTION, result=Result.INCONCLUSIVE, reason=f"{'; '.join(doubts)} ({found})")


def absent(names: Iterable[str], seen: Mapping[str, Observation]) -> list[str]:
    """Messages that were expected and never came, in the order given."""
    return [name for name in names if name not in seen or seen[name].at_ns.size == 0]
