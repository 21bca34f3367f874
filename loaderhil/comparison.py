"""The comparison of `loaderhil demo`: the same abrupt turn without and with the ECU's limits."""

from pathlib import Path

from hil.compose import Choice
from hil.ending import Ending
from hil.judgement import judge_run, timing_of
from hil.rundir import RunDirectory
from hil.shell.realtime_options import ORDINARY
from hil.verdict import Result, RunVerdict, Verdict, judge_prevention, judge_warning
from loaderhil.console import console, run_with_progress
from loaderhil.single import print_verdicts
from loaderhil.tables import add_roll_over_rows, add_timing_rows, two_columns
from report.run import write_report
from testbench.conclusion import exit_code, timing_verdicts

SCENARIO = "abrupt_articulation"
# Names are headings of the table and folders; the order is that of the columns.
RUNS = {"limits off": False, "limits on": True}


def run_demo(out: Path, *, fast: bool) -> Ending:
    """Run the scenario without and with limits, print figures and verdicts, write the report. Returns the exit code."""
    how = "in lockstep" if fast else "in real time, as processes on a CAN hub"
    console.print(
        f"A full joystick turn at speed, {how}. In the first run the ECU only warns, in the second it also limits.",
        soft_wrap=True,
    )
    folders = {name: out / name.replace(" ", "_") for name in RUNS}
    for name, limits in RUNS.items():
        choice = Choice(scenario=SCENARIO, limits=limits)
        result = run_with_progress(choice, folders[name], realtime=None if fast else ORDINARY, title=name)
        # a comparison needs both runs; the reason has been printed
        if result.ending is not Ending.PASSED:
            return result.ending

    runs = [RunDirectory.read(folder) for folder in folders.values()]
    # without limits first: it shows what the limits prevent
    free, limited = (judge_run(run) for run in runs)
    # the warning is judged without limits: with them no wheel may lift, and a warning could then not be late
    verdicts = [judge_roll_over(free), judge_warning(free), judge_prevention(free, limited)]
    table = two_columns(*RUNS)
    add_roll_over_rows(table, [free, limited])
    # lockstep has no timing: its clock is virtual
    if not fast:
        add_timing_rows(table, [timing_of(run) for run in runs])
        verdicts += [
            _named(name, kept) for name, run in zip(RUNS, runs, strict=True) for kept in timing_verdicts(run)
        ]
    console.print(table)
    print_verdicts(verdicts)
    # one page of both runs, its pictures side by side on one scale
    page = write_report(list(folders.values()), out / "report.html")
    console.print(f"report: {page}", soft_wrap=True)
    # the demo may run on a starved laptop: what cannot be judged there does not fail it
    return exit_code(verdicts, strict=False)


def judge_roll_over(free: RunVerdict) -> Verdict:
    """Whether the machine rolls over without limits. If not, the demo cannot show that limits prevent it."""
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
