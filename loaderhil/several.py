"""Runs several scenarios for `loaderhil run`: a run directory for each, one table, one exit code."""

from collections.abc import Sequence
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from hil.compose import Choice, ChoiceError
from hil.ending import Ending
from hil.gateway.buses import ONE_BUS, Buses
from hil.rundir import refuse_if_foreign
from hil.shell.realtime_options import RealtimeOptions
from loaderhil.console import console, run_with_progress
from loaderhil.single import FOR_PEOPLE, Output, print_remarks, print_verdicts
from loaderhil.tables import lift_off_text, seconds_text
from testbench.conclusion import Conclusion, conclude, expectations_for


def report_runs(
    choices: Sequence[Choice],
    out: Path,
    *,
    realtime: RealtimeOptions | None,
    strict: bool,
    buses: Buses = ONE_BUS,
    output: Output = FOR_PEOPLE,
) -> Ending:
    """Run every choice into its own folder of `out` and print the results. Returns the exit code of all.

    Errors in the user's input are found before the first run. Ctrl-C ends the series; the finished runs are still shown.
    """
    folders = _folders(choices, out)
    done: list[Conclusion] = []
    for choice, folder in zip(choices, folders, strict=True):
        result = run_with_progress(
            choice, folder, realtime=realtime, title=folder.name, buses=buses, quiet=output.json
        )
        # judged at once: what is finished has its verdicts even if a later run ends the series
        done.append(conclude(folder.name, choice, folder, result))
        # Ctrl-C means the whole series, not only the current run
        if done[-1].ending is Ending.INTERRUPTED:
            break
    if not output.json:
        console.print(summary(done))
        for run in done:
            print_remarks(run.remarks, of=run.name)
            print_verdicts(run.everything, of=run.name)
        console.print(f"run directories: {out}/")
    return output.give(done, strict=strict)


def _folders(choices: Sequence[Choice], out: Path) -> list[Path]:
    folders = [out / Path(choice.scenario).stem for choice in choices]
    for folder in folders:
        # two files of one name in different folders meet here as well
        if folders.count(folder) > 1:
            raise ChoiceError(f"{folder.name} is given twice; a run directory holds one run")
        # before the first run: a folder of the user's own must not be found out after an hour
        refuse_if_foreign(folder)
    # all files are read before the first run: a long series must not end at a misspelt key of its last scenario
    for choice in choices:
        choice.load()
        expectations_for(choice)
    return folders


def summary(done: Sequence[Conclusion]) -> Table:
    """One row per run."""
    headings = ("scenario", "true lift-off", "first warning", "rolls over", "largest roll", "smallest load")
    table = Table(*headings, box=None, header_style="bold", pad_edge=False)
    for run in done:
        seen = run.seen
        # a run that did not end well, or one of an external machine, has no truth to fill the row
        if seen is None:
            table.add_row(run.name, escape(run.reason))
            continue
        table.add_row(
            run.name,
            lift_off_text(seen),
            seconds_text(seen.warned_s),
            seconds_text(seen.rolled_over_s),
            f"{seen.largest_roll * 57.2958:.1f}°",
            f"{100 * seen.margin:.0f} %",
        )
    return table
