"""Judges whether the processes kept their times, and whether the host allowed a verdict.

Measured per process are lateness (start of a tick after its due time) and execution of the tick; across the bus the
reaction, from a sample's frame to the ECU's first status frame that echoes its sequence number, both by the recorder's
stamps. A miss on a starved host is inconclusive.

A host that gave enough time on the whole may still have kept one process waiting. A tick or a reaction is *explained*
when a single wait for a processor in it covers its excess over the permitted time. Explained ones then count with the
permitted time. Remaining misses are the software's; if none remains, the verdict is inconclusive.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.timing.waits import Rows, Wait, explaining, longest
from hil.verdict import Result, Verdict

PERIOD_NS = 10_000_000
LATEST_START = 0.5
"""Permitted lateness of a tick as a share of the period, 99th percentile."""
LONGEST_EXECUTION = 0.5
"""Permitted execution of a tick as a share of the period, 99th percentile."""
LONGEST_REACTION = 2.0
"""Permitted reaction in periods, 99th percentile: wait for the ECU's tick, compute, send."""
STOLEN = 0.01
"""Share of the machine's processor time given to other guests above which a miss is no evidence against the software."""
WAITED = 0.03
"""The same share for a process that is ready to run: 0.3 ms of each period. Our own processes cost one another less."""
MOMENT = 0.1
"""Either share within one second that can make a tick late although the whole run got its time."""
QUESTION = "every tick in time"
STARVED = "the host was starved"
SEQUENCES = 65_536
REACTION = "reaction"


@dataclass(frozen=True, slots=True)
class Spread:
    """Percentiles of a sample [ns]; NaN when it is empty."""

    median: float
    p99: float
    largest: float
    count: int

    @classmethod
    def of(cls, values_ns: ArrayLike) -> "Spread":
        """The spread of `values_ns`."""
        values = np.asarray(values_ns, float)
        if values.size == 0:
            return cls(float("nan"), float("nan"), float("nan"), 0)
        median, p99 = np.percentile(values, (50, 99))
        return cls(float(median), float(p99), float(values.max()), values.size)


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """The timing of one real-time run."""

    lateness: Mapping[str, Spread]  # process -> start of a tick after its due time [ns]
    execution: Mapping[str, Spread]  # process -> duration of a tick [ns]
    reaction: Spread  # [ns]
    overruns: Mapping[str, int]  # ticks skipped, of every process that has deadlines, measured or not
    dropped: int  # frames
    stolen: float  # share of the machine's processor time given to other guests, 0 to 1
    waited: Mapping[str, float]  # process -> share of time ready to run without a processor, 0 to 1
    worst_stolen: float = 0.0  # `stolen` in the worst second
    worst_waited: Mapping[str, float] = field(default_factory=dict)  # `waited` in the worst second
    hops: Mapping[str, Spread] = field(default_factory=dict)  # hop of a reaction -> duration [ns], in order
    own: "Timing | None" = None  # the same without explained excess; None where no waits were recorded
    # process or REACTION -> longest wait that explains a miss
    explained: Mapping[str, Wait] = field(default_factory=dict)
    longest_wait: Wait | None = None  # of all
    zero_ns: int = 0  # begin of the run on the clock of the waits


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskVerdict:
    """How one task kept its period; None: not measured."""

    name: str
    period_ns: int
    start: Spread | None  # lateness of its ticks [ns]
    execution: Spread | None  # [ns]
    overruns: int | None  # ticks skipped
    result: Result
    reason: str


def reactions(
    sample_s: ArrayLike, sample_sequence: ArrayLike, answer_s: ArrayLike, echo_sequence: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Arrival of each echoed sample [s], and the time from it to the first answer that echoes it [ns].

    Both in the order of arrival; sequences are 16 bit and wrap. A sample that was overtaken
    by a newer one before the ECU ticked has no reaction of its own.
    """
    samples = np.asarray(sample_s, float)
    sample = np.unwrap(np.asarray(sample_sequence, float), period=SEQUENCES)
    answers = np.asarray(answer_s, float)
    echo = np.asarray(echo_sequence, float)
    if samples.size == 0 or answers.size == 0:
        return np.empty(0), np.empty(0, np.int64)
    newest = np.searchsorted(samples, answers, side="right") - 1
    known = newest >= 0
    answers, echo, newest = answers[known], echo[known], newest[known]
    behind = (sample[newest] - echo) % SEQUENCES
    index = np.searchsorted(sample, sample[newest] - behind)
    echoed = (index < sample.size) & (behind < SEQUENCES / 2)
    answers, index = answers[echoed], index[echoed]
    _, first = np.unique(index, return_index=True)
    came = samples[index[first]]
    delays: NDArray[np.int64] = np.rint((answers[first] - came) * 1e9).astype(np.int64)
    return came, delays


def reaction_ns(
    sample_s: ArrayLike, sample_sequence: ArrayLike, answer_s: ArrayLike, echo_sequence: ArrayLike
) -> NDArray[np.int64]:
    """The time from each sample that was echoed to the first answer that echoes it [ns]."""
    return reactions(sample_s, sample_sequence, answer_s, echo_sequence)[1]


@dataclass(frozen=True, slots=True)
class Ticks:
    """Of one process, (n,) each [ns]: when a tick was due, how late it started, how long it took."""

    due_ns: NDArray[np.int64]
    lateness_ns: NDArray[np.int64]
    execution_ns: NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Explained:
    """The ticks of a process after waits have been considered; arrays (n,)."""

    lateness_ns: NDArray[np.int64]  # explained ticks have at most the permitted lateness
    execution_ns: NDArray[np.int64]  # explained ticks have at most the permitted execution
    skipped: NDArray[np.int64]  # ticks left out before each
    by_wait: NDArray[np.bool_]  # whether a wait explains the tick
    longest: Wait | None  # the longest wait that explains one


def explain_ticks(ticks: Ticks, waits: Mapping[str, Rows], period_ns: int = PERIOD_NS) -> Explained:
    """The ticks of a process, with those that its own waits for a processor explain."""
    step = np.diff(ticks.due_ns, prepend=ticks.due_ns[:1] - period_ns)
    same_life = step % period_ns == 0  # False at a restart: the new process has a grid of its own
    skipped = np.where(same_life, step // period_ns - 1, 0)
    permitted_late, permitted_long = round(LATEST_START * period_ns), round(LONGEST_EXECUTION * period_ns)
    late = ticks.lateness_ns + skipped * period_ns
    # Start and execution share one wait, so their excesses are added. A tick that left others out is as late as the
    # first of those.
    beyond = np.maximum(late - permitted_late, 0) + np.maximum(ticks.execution_ns - permitted_long, 0)
    ended = ticks.due_ns + ticks.lateness_ns + ticks.execution_ns
    by_wait = np.zeros(late.size, np.bool_)
    found = []
    for k in np.flatnonzero(beyond > 0).tolist():
        first_due = int(ticks.due_ns[k] - skipped[k] * period_ns)
        if wait := explaining(waits, first_due, int(ended[k]), int(beyond[k])):
            by_wait[k] = True
            found.append(wait)
    return Explained(
        lateness_ns=np.where(by_wait, np.minimum(ticks.lateness_ns, permitted_late), ticks.lateness_ns),
        execution_ns=np.where(by_wait, np.minimum(ticks.execution_ns, permitted_long), ticks.execution_ns),
        skipped=skipped,
        by_wait=by_wait,
        longest=longest(found),
    )


def explain_reactions(
    sample_ns: NDArray[np.int64],
    took_ns: NDArray[np.int64],
    waits: Mapping[str, Rows],
    period_ns: int = PERIOD_NS,
) -> tuple[NDArray[np.int64], Wait | None]:
    """Reactions [ns], explained ones set to the permitted time, and the longest wait that explains one. sample_ns: their begins."""
    permitted = round(LONGEST_REACTION * period_ns)
    own, found = took_ns.copy(), []
    for k in np.flatnonzero(took_ns > permitted).tolist():
        begin, took = int(sample_ns[k]), int(took_ns[k])
        if wait := explaining(waits, begin, begin + took, took - permitted):
            own[k] = permitted
            found.append(wait)
    return own, longest(found)


def judge_timing(timing: Timing, period_ns: int = PERIOD_NS) -> Verdict:
    """The verdict on all ticks and reactions of a run.

    A starved host can explain a late tick, but cannot make one in time: a run without a miss passes on any host.
    """
    if unmeasured := _unmeasured(timing):
        return Verdict(question=QUESTION, result=Result.INCONCLUSIVE, reason=f"not measured: {unmeasured}")
    misses = _misses(timing, period_ns)
    if misses and (starved := starvation(timing)):
        reason = "; ".join([f"{STARVED}: {starved}", *misses])
        return Verdict(question=QUESTION, result=Result.INCONCLUSIVE, reason=reason)
    if misses:
        own = misses if timing.own is None else _misses(timing.own, period_ns)
        result, reason = blamed(misses, own, timing, timing.explained.values())
        return Verdict(question=QUESTION, result=result, reason=reason)
    worst = max(spread.p99 for spread in timing.lateness.values())
    return Verdict(
        question=QUESTION,
        result=Result.PASSED,
        reason=f"99 % of ticks start within {worst * 1e-6:.2f} ms, no overrun, no frame lost",
    )


def judge_task(timing: Timing, name: str, period_ns: int = PERIOD_NS) -> TaskVerdict:
    """The verdict on one process alone; its misses on a starved host are inconclusive."""
    start, execution = (_measured(of.get(name)) for of in (timing.lateness, timing.execution))
    misses = _task_misses(timing, name, period_ns)
    if start is None or execution is None:
        result, reason = Result.INCONCLUSIVE, "not measured; did the process end before its time?"
    elif misses and (starved := starvation(timing)):
        result, reason = Result.INCONCLUSIVE, "; ".join([f"{STARVED}: {starved}", *misses])
    elif misses:
        own = misses if timing.own is None else _task_misses(timing.own, name, period_ns)
        result, reason = blamed(misses, own, timing, [w for of, w in timing.explained.items() if of == name])
    else:
        result, reason = Result.PASSED, f"{start.count} ticks in time"
    return TaskVerdict(
        name=name,
        period_ns=period_ns,
        start=start,
        execution=execution,
        overruns=timing.overruns.get(name),
        result=result,
        reason=reason,
    )


def _measured(spread: Spread | None) -> Spread | None:
    return spread if spread is not None and spread.count else None


def blamed(
    misses: Sequence[str], own: Sequence[str], timing: Timing, waits: Iterable[Wait]
) -> tuple[Result, str]:
    """Result and reason for misses: FAILED, unless the host starved the run in some second or single waits explain all of them.

    own: misses that no wait explains; waits: those that explain one.
    """
    reason = "; ".join(misses)
    if moment := starved_moment(timing):
        return Result.INCONCLUSIVE, f"{reason}; {STARVED} for a moment: {moment}"
    if not own and (wait := longest(waits)):
        return Result.INCONCLUSIVE, f"{reason}; {STARVED} for a moment: {wait.describe(timing.zero_ns)}"
    return Result.FAILED, reason


def starvation(timing: Timing) -> str:
    """Which processes the host gave too little time over the run, as text; '' if none."""
    if math.isnan(timing.stolen):
        return "its processor time was not measured"
    return _kept_from(timing.stolen, STOLEN, timing.waited, WAITED, "of the time")


def starved_moment(timing: Timing) -> str:
    """The same for the worst second, as text; it can explain a late tick."""
    return _kept_from(timing.worst_stolen, MOMENT, timing.worst_waited, MOMENT, "of its worst second")


def longest_wait_text(timing: Timing) -> str:
    """Duration and process of the longest wait; – if none was recorded or none lasted a millisecond."""
    wait = timing.longest_wait
    return "–" if wait is None else f"{wait.waited_ns * 1e-6:.1f} ms ({wait.process})"


def _kept_from(
    stolen: float, most_stolen: float, waited: Mapping[str, float], most_waited: float, of_what: str
) -> str:
    if stolen > most_stolen:
        return f"{100 * stolen:.1f} % {of_what} the processors went to other guests"
    waiting = [
        f"{name} waited {100 * share:.1f} % {of_what}"
        for name, share in waited.items()
        if share > most_waited
    ]
    return f"{', '.join(waiting)} for a processor" if waiting else ""


def _unmeasured(timing: Timing) -> str:
    missing = [
        f"lateness of {name}" for name in timing.overruns if _measured(timing.lateness.get(name)) is None
    ]
    if not timing.lateness:
        missing.append("lateness")
    if timing.reaction.count == 0:
        missing.append("reaction")
    return ", ".join(missing)


def _misses(timing: Timing, period_ns: int) -> list[str]:
    names = dict.fromkeys([*timing.overruns, *timing.lateness, *timing.execution])
    misses = [f"{name} {miss}" for name in names for miss in _task_misses(timing, name, period_ns)]
    if not timing.reaction.p99 <= LONGEST_REACTION * period_ns:
        misses.append(
            f"reaction p99 {timing.reaction.p99 * 1e-6:.1f} ms, "
            f"permitted {LONGEST_REACTION * period_ns * 1e-6:.0f} ms"
        )
    if timing.dropped:
        misses.append(f"{timing.dropped} frames lost")
    return misses


def _task_misses(timing: Timing, name: str, period_ns: int) -> list[str]:
    """The misses of one process, as text."""
    misses = [f"skipped {count} ticks"] if (count := timing.overruns.get(name)) else []
    for what, spreads, share in (
        ("starts late", timing.lateness, LATEST_START),
        ("takes too long", timing.execution, LONGEST_EXECUTION),
    ):
        spread = spreads.get(name)
        if spread is not None and not spread.p99 <= share * period_ns:
            permitted = f"permitted {share * period_ns * 1e-6:.1f} ms"
            misses.append(f"{what}: p99 {spread.p99 * 1e-6:.2f} ms, {permitted}")
    return misses
