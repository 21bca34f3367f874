"""`loaderhil compare`: two runs within tolerances."""

from pathlib import Path
from typing import Annotated

import typer


def compare(
    first: Annotated[Path, typer.Argument(metavar="RUN", help="Run directory that is the reference.")],
    second: Annotated[Path, typer.Argument(metavar="RUN", help="Run directory that is compared with it.")],
    tolerances: Annotated[
        Path | None, typer.Option("--tolerances", metavar="FILE", help="TOML file with tolerances.")
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="HTML page to write.")] = Path(
        "out/compare.html"
    ),
    json_output: Annotated[bool, typer.Option("--json", help="Print the verdicts as JSON.")] = False,
    junit: Annotated[
        Path | None, typer.Option("--junit", metavar="FILE", help="The verdicts also as JUnit XML.")
    ] = None,
) -> None:
    """Compare two runs: estimates, warnings, states and timing, each within a tolerance.

    Exit code 0: the same within the tolerances; 1: something differs; 5: something could not be compared. Example:
    `loaderhil compare out/before out/after --tolerances tolerances.toml`
    """
    from rich.console import Console
    from rich.markup import escape

    from dbc import loader_database
    from hil.check.tables import COLOUR
    from hil.results import Case, Suite, as_json, ending_of, write_junit
    from hil.rundir import RunDirectory
    from hil.verdict import Result
    from report.testing.comparison import page
    from report.testing.writing import write_page
    from testbench.compare.compare import compare as compared
    from testbench.compare.tolerances import Tolerances

    chosen = Tolerances.from_file(tolerances, loader_database()) if tolerances else Tolerances()
    found = compared(RunDirectory.read(first), RunDirectory.read(second), chosen)
    ending = ending_of(each.result for each in found)
    suite = Suite(name=f"{first} and {second}", cases=tuple(Case.of(each.verdict) for each in found))
    if junit is not None:
        write_junit(junit, "compare", [suite])
    # the page before the terminal: with --json it is still written
    file = write_page(page((str(first), str(second)), found), out)
    if json_output:
        print(as_json("compare", ending, [suite]))
        raise typer.Exit(ending)
    console = Console(highlight=False, soft_wrap=True)
    for each in found:
        if each.result is not Result.PASSED:
            console.print(
                f"[{COLOUR[each.result]}]{each.result.value:<12}[/] {each.kind.value}: {escape(each.name)}: {escape(each.reason)}"
            )
    differing = sum(each.result is Result.FAILED for each in found)
    console.print(f"{len(found)} comparisons, {differing} beyond their tolerance")
    console.print(f"page: {file}")
    raise typer.Exit(ending)


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(compare)
