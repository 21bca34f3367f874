"""Reads the frames to check from a recording or run directory, with the reasons to doubt them: losses, a busy host, faults."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from dbc import loader_database
from dbc.errors import LogError
from dbc.recordings.logfile import FrameTable
from dbc.recordings.reading import read_frames
from hil import rundir
from hil.check.check import Check, Rules, check, whole
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
SEVERITY = (Result.PASSED, Result.INCONCLUSIVE, Result.FAILED)


def read_observed(recording: Path) -> tuple[FrameTable, Observer]:
    """The frames and their observer; of a run directory the plant's bus, during the time in which the plant ticked."""
    if recording.is_dir():
        return _read_bus(RunDirectory.read(recording), *BUSES[PLANT_BUS])
    table = read_frames(recording)
    return table, whole(table)


def _read_bus(run: RunDirectory, log: str, recorder: str) -> tuple[FrameTable, Observer]:
    table = read_frames(run.path / log)
    observer = whole(table)
    if run.record.mode == "realtime":
        timing = timing_of(run)
        observer = replace(
            observer,
            starved=starvation(timing),
            starved_moment=starved_moment(timing),
            waits=waits_of_senders(run),
        )
    # before its first tick the plant compiles, and after its last one processes end: nobody is late then
    if "plant_due_ns" in run.timing and (due := run.timing["plant_due_ns"]).size:
        observer = replace(observer, start_ns=int(due[0]), end_ns=int(due[-1]))
    elif FOREIGN_ZERO in run.record.statistics:
        zero_ns = int(run.record.statistics[FOREIGN_ZERO])
        observer = replace(observer, start_ns=max(zero_ns, observer.start_ns))
    counts = run.record.statistics
    lost = observer.lost + int(counts.get(f"{recorder}_dropped", 0))
    dropped = sum(int(counts.get(f"{name}_dropped", 0)) for name in (*PROCESSES, "gateway"))
    return table, replace(observer, lost=lost, dropped=dropped, unfinished=run.record.outcome != "finished")


def punctuality_of(run: RunDirectory) -> Punctuality:
    """How a real-time run kept the times of its messages, on each of its buses, and of its tasks."""
    checks: dict[str, Check] = {}
    unread = []
    for bus, (log, recorder) in BUSES.items():
        if bus != PLANT_BUS and not (run.path / log).exists():
            continue  # without a gateway there is one bus and one log
        try:
            table, observer = _read_bus(run, log, recorder)
        except LogError as error:
            unread.append(str(error))
        else:
            named = replace(table, channels=(bus,) * len(table.channels))
            checks[bus] = check(named, [loader_database()], Rules(contents=False), observer=observer)
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
