"""`loaderhil diagnose`: what physics did the simulation leave out, told from recordings.

Exit codes: 0 explained, or nothing missing; 1 unknown: something is missing that the library does not name;
2 misused; 5 inconclusive: these recordings cannot tell.
"""

import importlib.metadata
import platform
import shlex
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bus.mistake import Mistake
from hil.diagnose.options import ConstantOption, ModelOption, PartOption, WithOption
from hil.ending import Ending
from hil.interruption import ended_at_once

if TYPE_CHECKING:
    from rich.console import Console

    from discrepancy.state import Progress
    from hil.diagnose.question import Question

EXIT = {
    "explained": int(Ending.PASSED),
    "nothing missing": int(Ending.PASSED),
    "unknown": int(Ending.FAILED),
    "inconclusive": int(Ending.INCONCLUSIVE),
}

COMPUTING_ENDS_S = 1.0
CLUSTER_ENDS_S = 20.0
"""How long Ctrl-C may take; workers on a cluster have to be told."""

EPILOG = (
    "Exit codes: 0 explained, or nothing missing; 1 unknown: something is missing that the library does not name; "
    "2 misused; 5 inconclusive: these recordings cannot tell; 130 interrupted."
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
    apply: Annotated[
        Path | None,
        typer.Option(
            "--apply",
            metavar="FILE.toml",
            help="Write the model extended by what was named; for the loader a machine file, equipment and calibration beside it.",
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
            help="Which column (or CAN `Message.Signal`) a channel is; A,B are averaged; may be repeated.",
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
            "--each", help="Every recording by itself, many at once, into results.parquet of --out."
        ),
    ] = False,
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler",
            metavar="ADDRESS",
            help="With --each: of a dask cluster; else processes of this machine.",
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers", min=1, help="With --each: processes of this machine; else one per processor."
        ),
    ] = None,
) -> None:
    """Find what a model leaves out: where it and the recordings differ, the effect's name and size, or that nothing is missing.

    Examples: `loaderhil diagnose drive.csv --model straight --out out/diagnosis`,
    `loaderhil diagnose out/gravel --model loader --apply mine.toml`, then `loaderhil run loaded --machine mine.toml`,
    `loaderhil diagnose drives/*.csv --model straight --each --out out/fleet`
    """
    with ended_at_once(CLUSTER_ENDS_S if each else COMPUTING_ENDS_S):
        from hil.diagnose.question import Question
        from hil.diagnose.reading import Ask, Misuse, measured, numbers, pairs

        ask = Ask(
            paths=recordings,
            part=part,
            renamed=pairs("--channel", channel or []),
            shifts=numbers("--shift", shift or []),
            constants=measured("--constant", constant or []),
            dbcs=dbc or [],
            bus=bus,
        )
        question = Question(model=model, given=given, ask=ask)
        # said before the work, not after it
        if out is not None:
            write("--out", out, {})
        if each:
            raise typer.Exit(_each(question, out, apply, scheduler, workers))
        if scheduler is not None or workers is not None:
            raise Misuse("--scheduler and --workers: spread many diagnoses; with --each they are")
        raise typer.Exit(_one(question, out, apply, everything=everything))


def _one(question: "Question", out: Path | None, apply: Path | None, *, everything: bool) -> int:
    """All recordings together: the verdict on the terminal, in DIR and in the files of --apply; the exit code."""
    from rich.console import Console

    from discrepancy.evidence import evidence
    from discrepancy.findings import to_json
    from discrepancy.state import Settings
    from discrepancy.words import tell
    from hil.diagnose.advice import advice
    from hil.diagnose.applying import application
    from hil.diagnose.page import page
    from hil.diagnose.question import answer

    if apply is not None:
        check_applicable(apply)
        write("--apply", apply.parent, {})
    settings, start = Settings(), time.monotonic()
    with told_progress(Console(stderr=True)) as progress:
        found = answer(question, settings, progress)
        result, shown = found.findings, None
        if out is not None and found.judged is not None:
            progress("predicting held-out stretches for the report")
            shown = evidence(found.judged, settings)
    console, steps = Console(soft_wrap=True), advice(result, question.model, out, applied=apply is not None)
    files, said = list[Path](), list[str]()
    if out is not None:  # before it is told, so that a reader of the words who leaves loses no result
        text = page(result, shown, steps, conditions(time.monotonic() - start, result.baseline))
        files += write("--out", out, {"findings.json": to_json(result), "report.html": text})
    try:
        if result.baseline:
            print(f"baseline: {result.baseline}")
        tell(result, console, all_candidates=everything)
        tell_steps(steps, console)
    finally:  # the same; and where it cannot be applied, the verdict has been told
        if apply is not None:
            outcome = application(found.choice, found.model, result, found.base.given, apply)
            said += outcome.said
            for path, text in outcome.files.items():
                files += write("--apply", path.parent, {path.name: text})
    for line in said:
        print(line)
    tell_written(files)
    return EXIT[result.status]


def _each(
    question: "Question", out: Path | None, apply: Path | None, scheduler: str | None, workers: int | None
) -> Ending:
    """Many recordings, each by itself."""
    from rich.console import Console

    from hil.diagnose.fleet import diagnose_each
    from hil.diagnose.reading import Misuse

    if out is None:
        raise Misuse("--each: needs --out DIR for its results")
    if apply is not None:
        raise Misuse("--each: each recording would --apply another model; apply the findings of one")
    tally = diagnose_each(question, out, scheduler, workers, Console(stderr=True))
    return Ending.FAILED if tally.failures else Ending.PASSED


def tell_steps(steps: Sequence[str], console: "Console") -> None:
    """What to do next."""
    from rich.markup import escape

    if steps:
        console.print("\n[bold]What to do next[/]")
    for step in steps:
        console.print(f"- {escape(step)}", highlight=False)


def conditions(seconds: float, baseline: str) -> dict[str, str]:
    """What was run, for the report; baseline: as in findings.json."""
    now = datetime.now(UTC)
    return {
        "command": shlex.join(["loaderhil", *sys.argv[1:]]),
        "when": f"{now:%Y-%m-%d %H:%M} UTC, in {seconds:.1f} s",
        "version": f"loaderhil {importlib.metadata.version('loaderhil')}, Python {platform.python_version()}",
        **({"baseline": baseline} if baseline else {}),
    }


def check_applicable(file: Path) -> None:
    """Refuse a name that no reader of the file would take. Raises Unwritable."""
    if file.suffix != ".toml":
        raise Unwritable(f"--apply {file}: must end in .toml")


def tell_written(files: Sequence[Path]) -> None:
    """A line for each."""
    for file in files:
        print(f"written: {file}")


def write(option: str, folder: Path, texts: Mapping[str, str]) -> list[Path]:
    """All files, each whole or not at all. Raises Unwritable, naming the option, where the folder cannot be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            part = folder / f".{name}.part"
            part.write_text(text, encoding="utf-8")
            part.replace(folder / name)
    except OSError as error:
        raise Unwritable(f"{option} {folder}: {error.strerror or error}") from error
    return [folder / name for name in texts]


class Unwritable(Mistake, ValueError):
    """The results cannot be written where they were wanted."""


@contextmanager
def told_progress(console: "Console") -> "Iterator[Progress]":
    """What is being done: one changing line on a terminal, a line per step with its second elsewhere."""
    start = time.monotonic()
    if console.is_terminal:
        with console.status("starting") as status:
            yield lambda text: status.update(f"{text} [dim]{time.monotonic() - start:.0f} s[/]")
        return
    yield lambda text: print(f"{time.monotonic() - start:6.1f} s  {text}", file=sys.stderr, flush=True)


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command(epilog=EPILOG)(diagnose)
