"""Several scenarios in one go: each its own run directory, then one table and one exit code."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from hil.compose import Choice, ChoiceError
from hil.console import console, exit_code, lift_off_text, perform, punctual, seconds_text, tell_verdicts
from hil.ending import Ending
from hil.gateway.buses import ONE_BUS, Buses
from hil.judgement import judge_run
from hil.realtime_options import RealtimeOptions
from hil.rundir import RunDirectory, refuse_if_foreign
from hil.verdict import RunVerdict, Verdict, judge_warning


@dataclass(frozen=True, slots=True)
class Done:
    """One run that came to an end; seen: None if there is nothing to judge."""

    name: str
    ending: Ending
    reason: str
    seen: RunVerdict | None
    verdicts: list[Verdict]


def tell_runs(
    choices: Sequence[Choice],
    out: Path,
    *,
    realtime: RealtimeOptions | None,
    strict: bool,
    buses: Buses = ONE_BUS,
) -> Ending:
    """Run every choice into its own folder of `out`, show what happened, and say how it ended as a whole.

    Everything the user gave is looked at before the first run; Ctrl-C ends all of them, with the table of those done.
    """
    folders = _folders(choices, out)
    done: list[Done] = []
    for choice, folder in zip(choices, folders, strict=True):
        done.append(_run(choice, folder, realtime=realtime, buses=buses))
        if done[-1].ending is Ending.INTERRUPTED:
            break
    console.print(summary(done))
    for run in done:
        tell_verdicts(run.verdicts, of=run.name)
    console.print(f"run directories: {out}/")
    return ending_of(done, strict=strict)


def _folders(choices: Sequence[Choice], out: Path) -> list[Path]:
    folders = [out / Path(choice.scenario).stem for choice in choices]
    for folder in folders:
        if folders.count(folder) > 1:
            raise ChoiceError(f"{folder.name} is named twice; one run directory cannot hold two runs")
        refuse_if_foreign(folder)
    for choice in choices:
        choice.load()
    return folders


def _run(choice: Choice, folder: Path, *, realtime: RealtimeOptions | None, buses: Buses) -> Done:
    result = perform(choice, folder, realtime=realtime, title=folder.name, buses=buses)
    if result.ending is not Ending.PASSED:
        return Done(folder.name, result.ending, result.reason, None, [])
    run = RunDirectory.read(folder)
    seen = judge_run(run)
    verdicts = [judge_warning(seen)] if seen.lifted else []
    return Done(folder.name, result.ending, result.reason, seen, verdicts + punctual(run))


def summary(done: Sequence[Done]) -> Table:
    """One row per run."""
    headings = ("scenario", "true lift-off", "first warning", "rolls over", "largest roll", "smallest load")
    table = Table(*headings, box=None, header_style="bold", pad_edge=False)
    for run in done:
        seen = run.seen
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


def ending_of(done: Sequence[Done], *, strict: bool) -> Ending:
    """INTERRUPTED if one was, else how the first that did not end well ended, else what the verdicts say."""
    endings = [run.ending for run in done if run.ending is not Ending.PASSED]
    if endings:
        return Ending.INTERRUPTED if Ending.INTERRUPTED in endings else endings[0]
    return exit_code([verdict for run in done for verdict in run.verdicts], strict=strict)
