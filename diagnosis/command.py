"""`loaderhil diagnose`: finds in recordings the physics that a simulation leaves out.

Exit codes: 0 explained, or nothing missing; 1 unknown, or explained in part: the model misses something that has no name;
2 wrong use; 5 inconclusive: these recordings allow no verdict.
"""

import importlib.metadata
import platform
import shlex
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bus.user_error import UserError
from diagnosis.options import (
    CompanionOption,
    ConstantOption,
    ModelOption,
    PartOption,
    SheetOption,
    WithOption,
)
from diagnosis.sheet import Sheet
from hil.ending import Ending
from hil.shell.interruption import ended_at_once

if TYPE_CHECKING:
    from rich.console import Console

    from diagnosis.question import Question
    from discrepancy.selection.state import Settings

EXIT = {
    "explained": int(Ending.PASSED),
    "nothing missing": int(Ending.PASSED),
    "explained in part": int(Ending.FAILED),
    "unknown": int(Ending.FAILED),
    "inconclusive": int(Ending.INCONCLUSIVE),  # not a failure: a script may ask for a better recording
}

COMPUTING_ENDS_S = 1.0
CLUSTER_ENDS_S = 20.0
"""Longest time after Ctrl-C until the process ends; workers on a cluster are stopped by a message first."""

EPILOG = (
    "Exit codes: 0 explained, or nothing missing; 1 unknown, or explained in part: the model misses something that has no name; "
    "2 wrong use; 5 inconclusive: these recordings allow no verdict; 130 interrupted."
)


def diagnose(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORDING...",
            help="Tables (.csv, .csv.gz, .parquet) headed `name [unit]`, CAN recordings with --dbc, run directories of the bench; "
            "A+B are files of one run.",
        ),
    ],
    model: ModelOption,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Write findings.json and report.html here.")
    ] = None,
    given: WithOption = None,
    companion: CompanionOption = None,
    sheet: SheetOption = Sheet.DATASHEET,
    apply: Annotated[
        Path | None,
        typer.Option(
            "--apply",
            metavar="FILE.toml",
            help="Write the model extended by the named effects; for the loader a machine file, with equipment and calibration beside it.",
        ),
    ] = None,
    part: PartOption = None,
    dbc: Annotated[
        list[Path] | None,
        typer.Option(
            "--dbc", metavar="FILE", help="For candump, BLF, ASC and MF4 recordings; may be repeated."
        ),
    ] = None,
    bus: Annotated[
        str | None,
        typer.Option("--bus", metavar="NAME", help="Only this bus of a recording of several: can0."),
    ] = None,
    channel: Annotated[
        list[str] | None,
        typer.Option(
            "--channel",
            metavar="NAME=COLUMN",
            help="Column (or CAN `Message.Signal`) of a channel, or of the time: `time=clock`; A,B are averaged; a formula is computed: `power=voltage * current`; a unit in brackets replaces that of the heading: `speed [km/h]=v`; may be repeated.",
        ),
    ] = None,
    constant: ConstantOption = None,
    shift: Annotated[
        list[str] | None,
        typer.Option(
            "--shift", metavar="NAME=SECONDS", help="Add to the stamps of a channel; may be repeated."
        ),
    ] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="List every candidate, not the best twelve.")
    ] = False,
    each: Annotated[
        bool,
        typer.Option(
            "--each",
            help="Diagnose each recording alone, many in parallel; results go to results.parquet of --out.",
        ),
    ] = False,
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler",
            metavar="ADDRESS",
            help="With --each: address of a dask cluster; default: processes of this machine.",
        ),
    ] = None,
    average: Annotated[
        bool,
        typer.Option(
            "--average",
            help="Average samples that come faster than the model moves, until 1 % of what a parameter does would be lost: for sampling rates far above the physics.",
        ),
    ] = False,
    set_aside: Annotated[
        bool,
        typer.Option(
            "--set-aside",
            help="Leave out intervals of time that nothing explains, at most a tenth of a channel, and search again; they are listed. Single wrong readings are left out in any case.",
        ),
    ] = False,
    window: Annotated[
        list[float] | None,
        typer.Option(
            "--window",
            metavar="SECONDS",
            help="Diagnose again with windows of this length; what depends on the length is said. May be repeated; each takes as long as one diagnosis.",
        ),
    ] = None,
    at_most: Annotated[
        float | None,
        typer.Option(
            "--at-most",
            metavar="SECONDS",
            min=0.0,
            help="Search no longer than this, then judge what was found, mostly as best proxies with their sizes. Judging takes a while more.",
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers", min=1, help="With --each: number of processes; default: one per processor."
        ),
    ] = None,
) -> None:
    """Find what a model leaves out: where it differs from the recordings, and the name and size of the missing effect.

    Examples: `loaderhil diagnose drive.csv --model straight --out out/diagnosis`,
    `loaderhil diagnose out/gravel --model loader --apply mine.toml`, then `loaderhil run loaded --machine mine.toml`,
    `loaderhil diagnose drives/*.csv --model straight --each --out out/fleet`
    """
    with ended_at_once(CLUSTER_ENDS_S if each else COMPUTING_ENDS_S):
        from diagnosis.question import Question
        from diagnosis.reading.reading import Misuse, ReadOptions, assigned, measured, numbers
        from discrepancy.selection.state import Settings

        given_channels = assigned(channel or [])
        options = ReadOptions(
            paths=recordings,
            part=part,
            renamed=given_channels.columns,
            units=given_channels.units,
            time=given_channels.time,
            shifts=numbers("--shift", shift or []),
            constants=measured("--constant", constant or []),
            dbcs=dbc or [],
            bus=bus,
        )
        question = Question(model=model, given=given, companion=companion, options=options, sheet=sheet)
        # an unwritable folder is reported now, not after minutes of computing
        if out is not None:
            write("--out", out, {})
        if each:
            if average or set_aside or window or at_most is not None:
                raise Misuse(
                    "--average, --set-aside, --window and --at-most: apply to one diagnosis, not with --each"
                )
            raise typer.Exit(_each(question, out, apply, scheduler, workers))
        if scheduler is not None or workers is not None:
            raise Misuse("--scheduler and --workers: apply to many diagnoses; add --each")
        settings = Settings(average=average, set_aside="intervals" if set_aside else "outliers")
        raise typer.Exit(_one(question, out, apply, settings, at_most, window or [], everything=everything))


def _one(
    question: "Question",
    out: Path | None,
    apply: Path | None,
    settings: "Settings",
    at_most: float | None,
    lengths: Sequence[float],
    *,
    everything: bool,
) -> int:
    """All recordings together: the verdict on the terminal, in DIR and in the files of --apply; the exit code."""
    from rich.console import Console

    from diagnosis.advice import advice
    from diagnosis.apply.applying import application
    from diagnosis.page import page
    from diagnosis.progress import shown_progress
    from diagnosis.question import diagnosed, prepared
    from diagnosis.terminal import render
    from diagnosis.window_lengths import across_lengths, checked_lengths
    from discrepancy.decision.evidence import evidence
    from discrepancy.signals.findings import Findings, to_json

    if apply is not None:
        check_applicable(apply)
        write("--apply", apply.parent, {})
    start = time.monotonic()
    with shown_progress(Console(stderr=True)) as progress:
        ready = prepared(question, progress)
        checked_lengths(lengths, ready.model)
        if at_most is not None:  # reading is no search
            settings = replace(settings, over=over_after(at_most))
        found = diagnosed(ready, settings, progress)
        others = dict[float, Findings]()
        for length in lengths:
            if settings.over():
                break
            progress(f"so far {found.findings.status}; again with windows of {length:g} s")
            other = diagnosed(ready, settings, progress, length).findings
            if not other.cut_short:  # its names are missing for want of time, not because of the length
                others[length] = other
        result, shown = across_lengths(found.findings, others), None
        if untried := [f"{length:g} s" for length in lengths if length not in others]:
            said = f"windows of {' and '.join(untried)} were not tried: the time was over"
            result = replace(result, reasons=[*result.reasons, said])
        # predictions for the page cost as much as a fit, so only where a page is written
        if out is not None and found.judged is not None:
            progress("predicting held-out segments for the report")
            shown = evidence(found.judged, settings)
    console, steps = Console(soft_wrap=True), advice(result, question.model, out, applied=apply is not None)
    files, messages = list[Path](), list[str]()
    if out is not None:  # before anything is printed: a closed pipe then loses no result
        text = page(result, shown, steps, conditions(time.monotonic() - start, result.baseline))
        files += write("--out", out, {"findings.json": to_json(result), "report.html": text})
    try:
        if result.baseline:
            print(f"baseline: {result.baseline}")
        render(result, console, all_candidates=everything)
        print_steps(steps, console)
    finally:  # for the same reason; and if --apply fails, the verdict has been printed
        if apply is not None:
            outcome = application(found.choice, found.model, result, found.base.given, apply)
            messages += outcome.messages
            for path, text in outcome.files.items():
                files += write("--apply", path.parent, {path.name: text})
    for line in messages:
        print(line)
    print_written(files)
    return EXIT[result.status]


def _each(
    question: "Question", out: Path | None, apply: Path | None, scheduler: str | None, workers: int | None
) -> Ending:
    """Many recordings, each by itself."""
    from rich.console import Console

    from diagnosis.fleet.fleet import diagnose_each
    from diagnosis.reading.reading import Misuse

    if out is None:
        raise Misuse("--each: needs --out DIR for its results")
    if apply is not None:
        raise Misuse(
            "--each: every recording would write another --apply file; diagnose one recording with --apply instead"
        )
    tally = diagnose_each(question, out, scheduler, workers, Console(stderr=True))
    return Ending.FAILED if tally.failures else Ending.PASSED


def over_after(seconds: float) -> Callable[[], bool]:
    """Whether so much time has passed since this call."""
    end = time.monotonic() + seconds
    return lambda: time.monotonic() > end


def print_steps(steps: Sequence[str], console: "Console") -> None:
    """Print the next steps."""
    from rich.markup import escape

    if steps:
        console.print("\n[bold]What to do next[/]")
    for step in steps:
        console.print(f"- {escape(step)}", highlight=False)


def conditions(seconds: float, baseline: str) -> dict[str, str]:
    """Command, time and versions, for the report; baseline: as in findings.json."""
    now = datetime.now(UTC)
    return {
        "command": shlex.join(["loaderhil", *sys.argv[1:]]),
        "when": f"{now:%Y-%m-%d %H:%M} UTC, in {seconds:.1f} s",
        "version": f"loaderhil {importlib.metadata.version('loaderhil')}, Python {platform.python_version()}",
        **({"baseline": baseline} if baseline else {}),
    }


def check_applicable(file: Path) -> None:
    """Raises Unwritable for a name that `--with` would not accept."""
    if file.suffix != ".toml":
        raise Unwritable(f"--apply {file}: must end in .toml")


def print_written(files: Sequence[Path]) -> None:
    """Print one line for each file."""
    for file in files:
        print(f"written: {file}")


def write(option: str, folder: Path, texts: Mapping[str, str]) -> list[Path]:
    """All files, each whole or not at all. Raises Unwritable, naming the option, where the folder cannot be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            # renamed when complete: a program that watches the folder never reads half a file
            part = folder / f".{name}.part"
            part.write_text(text, encoding="utf-8")
            part.replace(folder / name)
    except OSError as error:
        raise Unwritable(f"{option} {folder}: {error.strerror or error}") from error
    return [folder / name for name in texts]


class Unwritable(UserError, ValueError):
    """The results cannot be written to the given folder or file."""


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command(epilog=EPILOG)(diagnose)
