"""`loaderhil experiment`: finds the manoeuvre that distinguishes what the recordings cannot, and drives it on the bench.

Exit codes: 0 every finding has one name; 1 something is left that no manoeuvre of the list distinguishes, or that has no name; 2 wrong use;
5 a manoeuvre is proposed and has to be recorded.
"""

import time
from collections.abc import Sequence
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
    from diagnosis.blind.hidden import Truth
    from diagnosis.experiment.choosing import Site
    from diagnosis.experiment.rounds import Round
    from diagnosis.question import Answer, Question
    from discrepancy.selection.state import Settings

COMPUTING_ENDS_S = 1.0
EPILOG = (
    "Exit codes: 0 every finding has one name; 1 something is left that no manoeuvre of the list distinguishes, or that has no name; "
    "2 wrong use; 5 a manoeuvre is proposed and has to be recorded; 130 interrupted."
)


class NotTogether(UserError, ValueError):
    """Options that do not go together."""


def experiment(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORDING...",
            help="Run directories of the bench, or recordings as `diagnose` reads them.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Folder for experiment.html, the scenarios, and the diagnosis of every round.",
        ),
    ],
    model: ModelOption = "loader",
    scenario: Annotated[
        list[str] | None,
        typer.Option(
            "--scenario",
            metavar="NAME|FILE.toml",
            help="Choose among these scenarios; by default among those of the bench and some made for this; may be repeated.",
        ),
    ] = None,
    sealed: Annotated[
        Path | None,
        typer.Option(
            "--sealed",
            metavar="FILE",
            help="Drive the manoeuvres on the bench, with what `conceal` has sealed in this file; it is not shown.",
        ),
    ] = None,
    most: Annotated[
        int, typer.Option("--most", min=1, max=20, help="Manoeuvres that are driven at most, with --sealed.")
    ] = 3,
    given: WithOption = None,
    companion: CompanionOption = None,
    sheet: SheetOption = Sheet.DATASHEET,
    part: PartOption = None,
    constant: ConstantOption = None,
) -> None:
    """Find the manoeuvre that distinguishes best what the recordings cannot, and write it as a scenario; with --sealed, drive it and go on.

    Examples: `loaderhil experiment out/gravel --out out/next`, record the scenario that is proposed, then
    `loaderhil experiment out/gravel out/second --out out/next`; on the bench, `loaderhil conceal out/blind --model loader --random 1`, then
    `loaderhil experiment out/blind/run --sealed out/blind/truth.sealed --out out/next`
    """
    with ended_at_once(COMPUTING_ENDS_S):
        from diagnosis.blind.seal import unseal
        from diagnosis.command import write
        from diagnosis.question import Question
        from diagnosis.reading.reading import ReadOptions, measured
        from discrepancy.selection.state import Settings

        if scenario and model != "loader":
            raise NotTogether(f"--scenario: is for the loader; model {model} has its own manoeuvres")
        options = ReadOptions(paths=recordings, part=part, constants=measured("--constant", constant or []))
        question = Question(model=model, given=given, companion=companion, options=options, sheet=sheet)
        truth = unseal(sealed).truth if sealed is not None else None
        write("--out", out, {})
        done = _driven(question, scenario or [], Settings(), truth, out, most)
        raise typer.Exit(_ending(done[-1]))


def _ending(last: "Round") -> Ending:
    if last.resolved:
        return Ending.PASSED
    return Ending.INCONCLUSIVE if last.outcome == "proposed" else Ending.FAILED


def _driven(
    question: "Question",
    scenarios: Sequence[str],
    settings: "Settings",
    truth: "Truth | None",
    out: Path,
    most: int,
) -> "list[Round]":
    """All rounds; each is printed and written as it ends, so that an interruption loses no more than the current one."""
    from rich.console import Console

    from diagnosis.advice import advice
    from diagnosis.command import conditions, print_written, write
    from diagnosis.experiment.document import lines, page
    from diagnosis.experiment.document import to_json as experiment_json
    from diagnosis.experiment.rounds import rounds
    from diagnosis.page.page import page as diagnosis_page
    from diagnosis.progress import shown_progress
    from discrepancy.decision.evidence import evidence
    from discrepancy.signals.findings import to_json

    start, done, files = time.monotonic(), list["Round"](), list[Path]()
    with shown_progress(Console(stderr=True)) as progress:

        def site(answered: "Answer") -> "Site":
            return _site(answered, question, scenarios)

        for found, answered in rounds(question, site, settings, truth, out, most, progress):
            done.append(found)
            facts = conditions(time.monotonic() - start, found.findings.baseline)
            shown = evidence(answered.judged, settings) if answered.judged is not None else None
            steps = advice(found.findings, question.model, out, applied=False)
            report = diagnosis_page(found.findings, shown, steps, facts)
            texts = {"findings.json": to_json(found.findings), "report.html": report}
            write("--out", out / f"round-{found.number}", texts)
            files = write(
                "--out", out, {"experiment.json": experiment_json(done), "experiment.html": page(done, facts)}
            )
            print("\n".join(lines(found)), flush=True)
    print_written(files)
    return done


def _site(answered: "Answer", question: "Question", scenarios: Sequence[str]) -> "Site":
    from diagnosis.experiment.sites import BenchSite, ModelSite

    if answered.choice.build_from is None:
        return ModelSite(answered.model)
    return BenchSite(answered.choice, answered.base, question.sheet, scenarios)


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command(epilog=EPILOG)(experiment)
