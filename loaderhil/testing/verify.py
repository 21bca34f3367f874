"""`loaderhil verify`: are a user's expectations worth anything?"""

from pathlib import Path
from typing import Annotated

import typer

from loaderhil.options import EcuCoreOption, checked_core


def verify(
    tests: Annotated[
        Path,
        typer.Argument(
            metavar="TESTS", help="TOML file with [[expect]] tables: a scenario, or expectations alone."
        ),
    ],
    scenario: Annotated[
        str | None,
        typer.Option(
            "--scenario", metavar="NAME|FILE", help="Scenario to run expectations that stand alone with."
        ),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--only",
            metavar="PATTERN",
            help="Only mutants of this name or kind (`fault`, `ECU error`). Repeatable.",
        ),
    ] = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(
            "--effect",
            metavar="NAME",
            help="Also this effect of the machine, with typical values. Repeatable.",
        ),
    ] = None,
    at_s: Annotated[float, typer.Option("--at-s", min=0.0, help="When faults begin [s].")] = 2.0,
    ecu_core: EcuCoreOption = "auto",
    permit: Annotated[
        int, typer.Option("--permit", min=0, help="Number of mutants that nobody may notice before it fails.")
    ] = 0,
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="HTML page to write.")] = Path(
        "out/verify.html"
    ),
    json_output: Annotated[bool, typer.Option("--json", help="Print the verdicts as JSON.")] = False,
    junit: Annotated[
        Path | None, typer.Option("--junit", metavar="FILE", help="The verdicts also as JUnit XML.")
    ] = None,
) -> None:
    """Run expectations against faults, planted ECU errors and effects, and list those that nobody notices.

    Exit code 0: at most `--permit` went unnoticed; 1: more did, or an expectation fails without any. Example:
    `loaderhil verify criteria.toml --scenario loaded`
    """
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import Progress

    from hil.check.tables import COLOUR
    from hil.compose import Choice
    from hil.ending import Ending
    from hil.results import Case, Suite, as_json, write_junit
    from hil.verdict import Result
    from report.testing.verification import page
    from report.testing.writing import write_page
    from testbench.verify.mutants import mutants
    from testbench.verify.verify import verify as verified

    core = checked_core(ecu_core)
    choice = Choice(scenario=scenario or str(tests), expect=tests if scenario else None, core=core)
    chosen = mutants(only or [], effect or [], at_s)
    # transient: the bar disappears, and the list of results begins at the left edge
    with Progress(console=Console(stderr=True), transient=True) as progress:
        # one more than mutants: the run without any comes first
        task = progress.add_task("without any mutant", total=len(chosen) + 1)
        outcomes = list(
            verified(
                choice,
                chosen,
                lambda mutant, number: progress.update(task, description=mutant.name, completed=number + 1),
            )
        )
    # open ones are not missed: an expectation that cannot be judged ends `run` with exit code 5, which is noticed
    missed = [each for each in outcomes if each.result is Result.FAILED]
    ending = Ending.FAILED if len(missed) > permit else Ending.PASSED
    suite = Suite(name=str(tests), cases=tuple(Case.of(each.verdict, decides=False) for each in outcomes))
    if junit is not None:
        write_junit(junit, "verify", [suite])
    file = write_page(page(str(tests), choice.scenario, outcomes), out)
    if json_output:
        print(as_json("verify", ending, [suite]))
        raise typer.Exit(ending)
    console = Console(highlight=False, soft_wrap=True)
    words = {Result.PASSED: "noticed", Result.INCONCLUSIVE: "open", Result.FAILED: "UNNOTICED"}
    for each in outcomes:
        verdict = each.verdict
        console.print(
            f"[{COLOUR[each.result]}]{words[each.result]:<10}[/] {escape(verdict.question)}: {escape(verdict.reason)}"
        )
    console.print(
        f"{len(outcomes) - len(missed)} of {len(outcomes)} mutants noticed or open, {len(missed)} unnoticed"
    )
    console.print(f"page: {file}")
    raise typer.Exit(ending)


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(verify)
