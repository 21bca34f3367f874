"""Reads the frames to check from a recording or run directory, with the reasons to doubt them: losses, a busy host, faults."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dbc import loader_database
from dbc.database import Database
from dbc.errors import LogError
from dbc.recordings.part import Part, WrongPartError
from dbc.recordings.reading import Progress, read_pieces
from hil import rundir
from hil.check.check import Check, RecordingJudge, Rules
from hil.faults.record import read_faults
from hil.judgement import PROCESSES, timing_of, waits_of_senders
from hil.rundir import FOREIGN_ZERO, RunDirectory
from hil.timing.deadlines import QUESTION, Observer, doubtful, only_late, reasons_for_doubt
from hil.timing.measured import judge_task, judge_timing, starvation, starved_moment
from hil.timing.punctuality import Punctuality
from hil.verdict import Result, Verdict

PLANT_BUS, ECU_BUS = "plant bus", "ECU bus"
BUSES = {PLANT_BUS: (rundir.BUS, "recorder"), ECU_BUS: (rundir.ECU_BUS, "ecu-recorder")}
"""Bus -> file in the run directory, and the process that wrote it."""
ALL, WHOLE = Rules(), Part()
_NO_DOUBTS = Observer(start_ns=0, end_ns=0)
SEVERITY = (Result.PASSED, Result.INCONCLUSIVE, Result.FAILED)


@dataclass(frozen=True, slots=True, kw_only=True)
class Observed:
    """A recording to check, and what is known of its observer before a frame is read."""

    file: Path
    start_ns: int | None = None  # of the judged window; None: the first stamp
    end_ns: int | None = None  # None: the last stamp
    not_before_ns: int | None = None  # the window begins with the first stamp, but not before this time
    recording: Path  # what the user named: the file, or its run directory
    # reasons to doubt the recording; without its window, and lost without damaged lines
    doubts: Observer

    def begin(self, first_ns: int) -> int:
        """Start of the judged window, of a recording with this first stamp."""
        if self.start_ns is not None:
            return self.start_ns
        return first_ns if self.not_before_ns is None else max(self.not_before_ns, first_ns)

    def observer(self, whole: Observer) -> Observer:
        """The observer, with its window. whole: that of all frames."""
        return replace(
            self.doubts,
            start_ns=self.begin(whole.start_ns),
            end_ns=whole.end_ns if self.end_ns is None else self.end_ns,
            lost=whole.lost + self.doubts.lost,
        )


def check_observed(
    seen: Observed,
    databases: Sequence[Database],
    rules: Rules = ALL,
    *,
    part: Part = WHOLE,
    named: str | None = None,
    progress: Progress | None = None,
) -> Check:
    """The verdicts on a recording, read piece by piece; its memory does not grow with the file.

    named: what every channel is called. LogError if it cannot be read; WrongPartError if it has no such part.
    """
    since_ns = seen.not_before_ns if seen.start_ns is None else seen.start_ns
    until_ns = seen.end_ns
    if part.is_timed:
        start_ns = seen.begin(_first_stamp(seen.file)) if seen.start_ns is None else seen.start_ns
        since_ns, until_ns = part.bounds(start_ns, until_ns)
    judge = RecordingJudge(
        databases, rules, since_ns=since_ns, until_ns=until_ns, channel=part.channel, waits=seen.doubts.waits
    )
    for piece in read_pieces(seen.file, progress):
        judge.take(piece)
    if part.channel is not None and part.channel not in judge.channels:
        raise WrongPartError(
            f"{seen.recording}: no channel {part.channel!r}; there are {', '.join(judge.channels)}"
        )
    observer = seen.observer(judge.observer())
    begin_ns, stop_ns = part.window(observer.start_ns, observer.end_ns)
    return judge.check(replace(observer, start_ns=begin_ns, end_ns=stop_ns), named)


def _first_stamp(file: Path) -> int:
    """The earliest stamp; the stamps of a recording need not be in order, so that all are read."""
    return min(int(piece.time_ns.min()) for piece in read_pieces(file) if len(piece))


def observed(recording: Path) -> Observed:
    """A recording, or of a run directory the plant's bus, during the time in which the plant ticked."""
    if recording.is_dir():
        return _bus(RunDirectory.read(recording), *BUSES[PLANT_BUS])
    return Observed(file=recording, recording=recording, doubts=_NO_DOUBTS)


def _bus(run: RunDirectory, log: str, recorder: str) -> Observed:
    counts = run.record.statistics
    doubts = replace(
        _NO_DOUBTS,
        lost=int(counts.get(f"{recorder}_dropped", 0)),
        dropped=sum(int(counts.get(f"{name}_dropped", 0)) for name in (*PROCESSES, "gateway")),
        unfinished=run.record.outcome != "finished",
    )
    if run.record.mode == "realtime":
        timing = timing_of(run)
        doubts = replace(
            doubts,
            starved=starvation(timing),
            starved_moment=starved_moment(timing),
            waits=waits_of_senders(run),
        )
    seen = Observed(file=run.path / log, recording=run.path, doubts=doubts)
    # before its first tick the plant compiles, and after its last one processes end: nobody is late then
    if "plant_due_ns" in run.timing and (due := run.timing["plant_due_ns"]).size:
        return replace(seen, start_ns=int(due[0]), end_ns=int(due[-1]))
    if FOREIGN_ZERO in counts:
        return replace(seen, not_before_ns=int(counts[FOREIGN_ZERO]))
    return seen


def punctuality_of(run: RunDirectory) -> Punctuality:
    """How a real-time run kept the times of its messages, on each of its buses, and of its tasks."""
    checks: dict[str, Check] = {}
    unread = []
    for bus, (log, recorder) in BUSES.items():
        if bus != PLANT_BUS and not (run.path / log).exists():
            continue  # without a gateway there is one bus and one log
        try:
            checks[bus] = check_observed(
                _bus(run, log, recorder), [loader_database()], Rules(contents=False), named=bus
            )
        except LogError as error:
            unread.append(str(error))
    timing = timing_of(run)
    struck = sum(fault.struck > 0 for fault in read_faults(run.path))
    return Punctuality(
        frames=all_frames(checks, unread, struck),
        ticks=judge_timing(timing),
        messages=tuple(message for check in checks.values() for message in check.messages),
        tasks=tuple(judge_task(timing, name) for name in PROCESSES if name not in run.record.foreign),
    )


def all_frames(checks: Mapping[str, Check], unread: Sequence[str], struck: int) -> Verdict:
    """One verdict over the checks of several buses, by name.

    unread: why a bus could not be read. struck: number of injected faults that affected frames.
    """
    doubts = dict.fromkeys(
        [
            *unread,
            *(
                doubt
                for check in checks.values()
                for doubt in reasons_for_doubt(check.observer, late=only_late(check.messages, check.observer))
            ),
        ]
    )
    if doubts:
        return doubtful([message for check in checks.values() for message in check.messages], list(doubts))
    worst = max((check.overall.result for check in checks.values()), key=SEVERITY.index)
    reasons = [
        f"{bus}: {check.overall.reason}" if len(checks) > 1 else check.overall.reason
        for bus, check in checks.items()
        if check.overall.result is worst
    ]
    # an injected fault may be why frames were late, and may hide that the bench itself was late
    if worst is Result.FAILED and struck:
        worst = Result.INCONCLUSIVE
        reasons.insert(0, f"injected faults affected frames ({struck} faults) and may be the cause")
    return Verdict(question=QUESTION, result=worst, reason="; ".join(reasons))
