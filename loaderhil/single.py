"""Runs one scenario for `loaderhil run` and the demo: figures, verdicts, exit code."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.markup import escape

from hil.check.tables import COLOUR, several_channels, table_of
from hil.compose import Choice
from hil.ending import Ending
from hil.faults.record import Injected, read_faults
from hil.gateway.buses import ONE_BUS, Buses
from hil.judgement import timing_of
from hil.results import as_json, write_junit
from hil.rundir import RECORD, RunDirectory
from hil.shell.realtime_options import RealtimeOptions
from hil.verdict import Verdict
from loaderhil.console import console, run_with_progress
from loaderhil.tables import (
    add_hop_rows,
    add_memory_rows,
    add_roll_over_rows,
    add_timing_rows,
    two_columns,
)
from testbench.conclusion import Conclusion, conclude, ending_of, expectations_for, suite_of

LATE_SHOWN = 6
"""Most late messages in the terminal: one late process makes all its messages late."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """The form of the results."""

    json: bool = False  # one JSON object, and nothing else on standard output
    junit: Path | None = None  # file to which the results are also written as JUnit XML

    def give(self, conclusions: Sequence[Conclusion], *, strict: bool) -> Ending:
        """Write the results where they were asked for. Returns the exit code of all runs."""
        # once for all forms: exit code, JSON and JUnit must not differ
        ending = ending_of(conclusions, strict=strict)
        suites = [suite_of(each, strict=strict) for each in conclusions]
        if self.junit is not None:
            write_junit(self.junit, "run", suites)
        if self.json:
            print(as_json("run", ending, suites))
        return ending


FOR_PEOPLE = Output()


def report_run(
    choice: Choice,
    out: Path,
    *,
    realtime: RealtimeOptions | None,
    strict: bool,
    buses: Buses = ONE_BUS,
    output: Output = FOR_PEOPLE,
) -> Ending:
    """Run one scenario and give its results. Returns the exit code."""
    name = Path(choice.scenario).stem
    expectations_for(choice)  # a mistake in a table is reported before the run, not after it
    result = run_with_progress(choice, out, realtime=realtime, title=name, buses=buses, quiet=output.json)
    concluded = conclude(name, choice, out, result)
    # of a run that was cut off the figures would be those of a part; its reason has been printed
    if result.ending is Ending.PASSED and not output.json:
        _print_run(concluded)
    return output.give([concluded], strict=strict)


def _print_run(concluded: Conclusion) -> None:
    """Print the figures, verdicts and remarks of one run."""
    run = RunDirectory.read(concluded.folder)
    table = two_columns()
    if concluded.seen is not None:
        add_roll_over_rows(table, [concluded.seen])
    # lockstep computes on a virtual clock; its times say nothing of the computer
    if run.record.mode == "realtime":
        timing = timing_of(run)
        add_timing_rows(table, [timing])
        add_hop_rows(table, [timing])
        add_memory_rows(table, run.record.vitals)
    console.print(table)
    print_late_messages(run)
    print_remarks(concluded.remarks)
    print_verdicts(concluded.everything)
    print_faults(read_faults(concluded.folder))
    console.print(f"run directory: {concluded.folder}")


def print_late_messages(run: RunDirectory) -> None:
    """Print the messages that were not in time, those with the most events first."""
    kept = run.record.punctuality
    # messages in time are in the report; a table of forty good rows would hide the bad one
    late = [one for one in kept.messages if one.verdict.events] if kept else []
    if not kept or not late:
        return
    # the worst first, because only LATE_SHOWN of them are printed
    late.sort(key=lambda one: one.verdict.missing + one.verdict.late + one.verdict.early, reverse=True)
    console.print(table_of(late[:LATE_SHOWN], channels=several_channels(kept.messages)))
    if len(late) > LATE_SHOWN:
        console.print(
            f"and {len(late) - LATE_SHOWN} more: {run.path / RECORD}, or the report", soft_wrap=True
        )


def print_faults(faults: Sequence[Injected]) -> None:
    """Print the injected faults, one line each."""
    for fault in faults:
        # a fault without an end, or one that the end of the run cut off
        until = "the end" if fault.ended_s is None else f"{fault.ended_s:.2f} s"
        affected = f"{fault.struck} frames" if fault.struck else "no frame"
        console.print(
            f"injected     {escape(fault.fault)}: {fault.began_s:.2f} s to {until}, {affected}",
            soft_wrap=True,
        )


def print_verdicts(verdicts: Sequence[Verdict], of: str = "") -> None:
    """Print one line per verdict: result, name of the run if there are several, question, reason."""
    run = f"{escape(of)}: " if of else ""
    for verdict in verdicts:
        colour = COLOUR[verdict.result]
        console.print(
            # 12: the longest result, INCONCLUSIVE, so that the questions stand below one another
            f"[{colour}]{verdict.result.value:<12}[/] {run}{escape(verdict.question)}: {escape(verdict.reason)}",
            soft_wrap=True,
        )


def print_remarks(remarks: Sequence[str], of: str = "") -> None:
    """Print the facts that a reader must not overlook, one line each."""
    run = f"{escape(of)}: " if of else ""
    for remark in remarks:
        console.print(f"[yellow]note[/]         {run}{escape(remark)}", soft_wrap=True)
