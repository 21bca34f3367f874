"""`loaderhil demo`: the same abrupt turn twice, without and with the ECU's limits."""

from pathlib import Path

from hil.compose import Choice
from hil.console import (
    add_roll_over_rows,
    add_timing_rows,
    console,
    exit_code,
    perform,
    punctual,
    tell_verdicts,
    two_columns,
)
from hil.ending import Ending
from hil.judgement import judge_run, timing_of
from hil.realtime_options import ORDINARY
from hil.report import write_report
from hil.rundir import RunDirectory
from hil.verdict import Result, RunVerdict, Verdict, judge_prevention, judge_warning

SCENARIO = "abrupt_articulation"
RUNS = {"limits off": False, "limits on": True}


def run_demo(out: Path, *, fast: bool) -> Ending:
    """Run both, print the comparison and the verdicts, write the report."""
    where = "in lockstep" if fast else "as processes on a hub, in real time"
    console.print(
        f"A full joystick turn at speed, {where}: first the ECU only warns, then it limits.", soft_wrap=True
    )
    folders = {name: out / name.replace(" ", "_") for name in RUNS}
    for name, limits in RUNS.items():
        choice = Choice(scenario=SCENARIO, limits=limits)
        result = perform(choice, folders[name], realtime=None if fast else ORDINARY, title=name)
        if result.ending is not Ending.PASSED:
            return result.ending

    runs = [RunDirectory.read(folder) for folder in folders.values()]
    free, limited = (judge_run(run) for run in runs)
    verdicts = [judge_roll_over(free), judge_warning(free), judge_prevention(free, limited)]
    table = two_columns(*RUNS)
    add_roll_over_rows(table, [free, limited])
    if not fast:
        add_timing_rows(table, [timing_of(run) for run in runs])
        verdicts += [
            _named(name, kept) for name, run in zip(RUNS, runs, strict=True) for kept in punctual(run)
        ]
    console.print(table)
    tell_verdicts(verdicts)
    page = write_report(list(folders.values()), out / "report.html")
    console.print(f"report: {page}", soft_wrap=True)
    return exit_code(verdicts, strict=False)


def judge_roll_over(free: RunVerdict) -> Verdict:
    """Does the machine roll over when nothing limits it? Otherwise the demo shows nothing."""
    rolled = free.rolled_over_s is not None
    return Verdict(
        question="without the limits the machine rolls over",
        result=Result.PASSED if rolled else Result.FAILED,
        reason=f"at {free.rolled_over_s:.2f} s"
        if rolled
        else f"largest roll angle {free.largest_roll:.2f} rad",
    )


def _named(name: str, verdict: Verdict) -> Verdict:
    return Verdict(question=f"{verdict.question}, {name}", result=verdict.result, reason=verdict.reason)
