"""Deadlines of cyclic messages, judged from the DBC's cycle times.

Pure: stamps, counters and payloads in, verdicts out; the same for a running bus and for a recording.
The period T of a message is its GenMsgCycleTime. Between two frames of a message, with gap g:

- g > T (1 + tolerance): *late*, and where g >= 1.5 T, round(g/T) - 1 frames are *missing*; when the next frame is early,
  this one was delayed: then round((g + g')/T) - 2 over both gaps;
- g < T (1 - tolerance): *early*;
- the alive counter stands still: *duplicate*, when the payload is the same too, else a *counter jump*;
- the alive counter advances by n > 1: *counter jump*, n - 1 frames lost between sender and us.

The silence before the first and after the last frame counts like a gap: a message that stops is late.
A message is *stale* over every stretch that lasts longer than `stale_after` periods; the share of the
judged time spent so is given. A NaN or a stamp that runs backwards is a failure, never a pass.

What cannot be judged is inconclusive, with the reason: no period in the DBC, less than three periods of
observation, an observer that lost frames, or a host that did not give the observer its time. So is what was late, when
one wait for a processor, in the sender or in what its frames pass, is as long as all that was late by more than permitted.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
    """What was seen of one message.

    at_ns: (n,) stamps in the order of arrival; counters: (n,) alive counters or None where the message has
    none, counted modulo `modulus`; same_payload: (n,) whether a frame equals the one before it, or None where that was not kept. sender: its node.
    """

    name: str
    period_ns: int | None
    at_ns: NDArray[np.int64]
    counters: NDArray[np.int64] | None = None
    same_payload: NDArray[np.bool_] | None = None
    sender: str = ""
    modulus: int = COUNTER_MODULUS


@dataclass(frozen=True, slots=True, kw_only=True)
class Observer:
    """How far the observer itself can be trusted.

    start_ns, end_ns: the judged window. lost: frames that it knows it lost. starved: why the host did not
    give it (or the sender) time enough, '' when it did. starved_moment: the same of its worst second, which
    may be why a frame was late. unfinished: whether the run was cut off. waits: by node, of the processes that a frame of
    it comes from and passes, see `hil.timing.waits`.
    """

    start_ns: int
    end_ns: int
    lost: int = 0
    starved: str = ""
    starved_moment: str = ""
    unfinished: bool = False
    waits: Mapping[str, Mapping[str, Rows]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class MessageVerdict:
    """How one message kept its period. Counts of events; gaps [ns], None where there are none; stale_share 0..1."""

    name: str
    period_ns: int | None
    frames: int
    late: int = 0
    early: int = 0
    missing: int = 0
    duplicates: int = 0
    counter_jumps: int = 0
    lost_frames: int = 0
    backwards: int = 0
    stale_share: float = 0.0
    median_gap_ns: float | None = None
    worst_gap_ns: int | None = None
    worst_at_ns: int | None = None
    result: Result
    reason: str

    @property
    def events(self) -> list[str]:
        """What was found against the message, whatever may be concluded from it."""
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
    """The verdict on one message of one channel; sender: the first that the DBC names."""

    channel: str
    sender: str
    verdict: MessageVerdict


def judge_message(
    seen: Observation,
    observer: Observer,
    *,
    tolerance: float = TOLERANCE,
    stale_after: float = STALE_AFTER,
) -> MessageVerdict:
    """The verdict on one message over the observer's window."""
    frames = int(seen.at_ns.size)
    if seen.period_ns is None or seen.period_ns <= 0:
        reason = "the DBC gives no cycle time: nothing to judge it by"
        return MessageVerdict(
            name=seen.name, period_ns=None, frames=frames, result=Result.INCONCLUSIVE, reason=reason
        )
    period = seen.period_ns
    window = observer.end_ns - observer.start_ns
    if window < LEAST_PERIODS * period:
        wanted = f"{LEAST_PERIODS} periods of {period * 1e-6:.0f} ms"
        reason = f"observed for {window * 1e-6:.0f} ms, less than {wanted}"
        return MessageVerdict(
            name=seen.name, period_ns=period, frames=frames, result=Result.INCONCLUSIVE, reason=reason
        )
    edges = np.concatenate(([observer.start_ns], seen.at_ns, [observer.end_ns])).astype(np.int64)
    gaps = np.diff(edges)
    inner = gaps[1:-1]
    # The two outer gaps are cut by the window, so they can only be too long, never early.
    late = gaps > period * (1 + tolerance)
    missing = np.where(gaps >= 1.5 * period, _skipped(gaps, period, tolerance), 0)
    missing[[0, -1]] = np.floor(gaps[[0, -1]] / period)  # no neighbour outside the window to round towards
    missing[[0, -1]] *= late[[0, -1]]
    worst = int(np.argmax(gaps))
    duplicates, jumps, lost = _counter_events(seen, period)
    verdict = MessageVerdict(
        name=seen.name,
        period_ns=period,
        frames=frames,
        late=int(np.count_nonzero(late)),
        early=int(np.count_nonzero((inner < period * (1 - tolerance)) & (inner >= 0))),
        missing=int(missing.sum()),
        duplicates=duplicates,
        counter_jumps=jumps,
        lost_frames=lost,
        backwards=int(np.count_nonzero(inner < 0)),
        stale_share=float(np.maximum(gaps - stale_after * period, 0).sum() / window),
        median_gap_ns=float(np.median(inner)) if inner.size else None,
        worst_gap_ns=int(gaps[worst]),
        worst_at_ns=int(edges[worst]),
        result=Result.PASSED,
        reason="",
    )
    return _concluded(
        verdict,
        observer,
        _excuse(verdict, edges, late | (missing > 0), tolerance, observer.waits.get(seen.sender, {})),
    )


def _excuse(
    verdict: MessageVerdict,
    edges: NDArray[np.int64],
    late: NDArray[np.bool_],
    tolerance: float,
    waits: Mapping[str, Rows],
) -> Wait | None:
    """The longest wait for a processor, if there is one for each gap that is too long or too short, and nothing else is wrong.

    late: of each gap, whether it is too long.
    """
    period = verdict.period_ns
    if period is None or not waits or verdict.duplicates or verdict.counter_jumps or verdict.backwards:
        return None
    found = []
    permitted = round(period * (1 + min(tolerance, 0.5)))  # from 1.5 periods on a frame is missing
    for row in np.flatnonzero(late).tolist():
        begin, end = int(edges[row]), int(edges[row + 1])
        beyond = max(end - begin - permitted, 1)
        # One that is over before the frame was due delays it only if its sender skips ticks and goes on with its schedule
        # later: then it is as long as the whole delay.
        wait = explaining(waits, begin, end, beyond, beyond_ns=begin + period)
        wait = wait or explaining(waits, begin, end, end - begin - period)
        found.append(wait)
    early = np.diff(edges)[1:-1] < period * (1 - tolerance)
    for row in (1 + np.flatnonzero(early)).tolist():
        begin, end = int(edges[row]), int(edges[row + 1])
        found.append(explaining(waits, end - period, begin, begin + round(period * (1 - tolerance)) - end))
    explained = [wait for wait in found if wait is not None]
    return longest(explained) if len(explained) == len(found) else None


def _skipped(gaps: NDArray[np.int64], period: int, tolerance: float) -> NDArray[np.float64]:
    """Frames that did not come within each gap. A delayed frame is none of them: the one after it is early."""
    following = np.full(gaps.size, np.inf)
    following[:-2] = gaps[1:-1]  # the last gap ends with the window, not with a frame
    caught_up = (following >= 0) & (following < period * (1 - tolerance))
    until = gaps + np.where(caught_up, following, 0.0)
    skipped: NDArray[np.float64] = np.rint(until / period) - np.where(caught_up, 2, 1)
    return skipped


def _counter_events(seen: Observation, period_ns: int) -> tuple[int, int, int]:
    """Duplicates, counter jumps, and the frames that the jumps say were lost.

    The counter knows a step only modulo 15; the time between the frames says which of the candidates it was.
    """
    if seen.counters is None or seen.counters.size < 2:
        return 0, 0, 0  # without a counter, a repeated value looks like a repeated frame
    modulo = np.diff(seen.counters) % seen.modulus
    periods = np.diff(seen.at_ns) / period_ns
    turns = np.maximum(np.rint((periods - modulo) / seen.modulus), 0)
    step = (modulo + seen.modulus * turns).astype(np.int64)
    still = step == 0
    duplicate = still if seen.same_payload is None else still & seen.same_payload[1:]
    outside = (seen.counters < 0) | (seen.counters >= seen.modulus)
    jump = (step > 1) | (still & ~duplicate) | outside[1:]
    return int(duplicate.sum()), int(jump.sum()), int((step[step > 1] - 1).sum())


def _concluded(verdict: MessageVerdict, observer: Observer, excuse: Wait | None) -> MessageVerdict:
    """Passed, failed, or why it cannot be said."""
    events = verdict.events
    doubts = doubts_of(observer, late=bool(events))
    if events and not doubts and observer.starved_moment:
        doubt = f"{MOMENTARILY}: {observer.starved_moment}"
        result, reason = Result.INCONCLUSIVE, "; ".join([*events, doubt])
    elif events and not doubts and excuse is not None:
        doubt = f"{MOMENTARILY}: {excuse.describe(observer.start_ns)}"
        result, reason = Result.INCONCLUSIVE, "; ".join([*events, doubt])
    elif events and not doubts:
        result, reason = Result.FAILED, "; ".join(events)
    elif doubts:
        result, reason = Result.INCONCLUSIVE, "; ".join([*doubts, *events])
    else:
        result, reason = Result.PASSED, f"{verdict.frames} frames in time"
    return replace(verdict, result=result, reason=reason)


def doubts_of(observer: Observer, *, late: bool) -> list[str]:
    """Why this observer's findings decide nothing; [] when they do.

    late: whether anything was not in time. A starved host may be why something was late; it makes nothing early enough.
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
    """The verdict of an observer in doubt, with what was found nevertheless."""
    suspect = sum(1 for one in judged if one.verdict.events)
    found = f"{suspect} of {len(judged)} messages not in time" if suspect else "nothing found late"
    return Verdict(question=QUESTION, result=Result.INCONCLUSIVE, reason=f"{'; '.join(doubts)} ({found})")


def absent(names: Iterable[str], seen: Mapping[str, Observation]) -> list[str]:
    """Messages that were expected and never came, in the order given."""
    return [name for name in names if name not in seen or seen[name].at_ns.size == 0]


def same_as_before(payloads: ArrayLike) -> NDArray[np.bool_]:
    """Whether each payload equals the one before it; payloads: (n, width) bytes. The first never does."""
    rows = np.asarray(payloads)
    equal = np.zeros(rows.shape[0], np.bool_)
    equal[1:] = (rows[1:] == rows[:-1]).all(axis=1)
    return equal
