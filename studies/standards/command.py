"""`loaderhil standards`: standards for earth-moving machinery as tests of a simulated machine."""

from pathlib import Path
from typing import Annotated

import typer

from bus.user_error import UserError

NAMES = ("tipping", "stopping", "steering", "slope")
EPILOG = "Exit codes: 0 every requirement is met; 1 one is not; 2 wrong use; 5 a value could not be measured; 130 interrupted."


class NoSuchStandard(UserError, ValueError):
    """There is no test of this name."""


def standards(
    name: Annotated[
        str | None, typer.Argument(help=f"One of {', '.join(NAMES)}; all of them if left out.")
    ] = None,
    machine: Annotated[
        str,
        typer.Option(
            "--machine", metavar="NAME|FILE", help="A machine that comes with loaderhil, or a TOML file."
        ),
    ] = "l60",
    equipment: Annotated[
        str | None,
        typer.Option(
            "--equipment",
            metavar="NAME|FILE",
            help="Its equipment, above all the brakes; default: the file beside the machine's, else its family's.",
        ),
    ] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Change a value: the key of a file after `machine.` or `equipment.`; may be repeated.",
        ),
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the page.")] = Path(
        "out/standards"
    ),
) -> None:
    """Test a machine against standards: tipping load, stopping distance, steering course, 30° slope.

    Examples: `loaderhil standards`, `loaderhil standards stopping --set equipment.actuators.service_brake_front_rear_kn_m=[9,7]`
    """
    from rich.console import Console
    from rich.progress import track

    from hil.results import ending_of
    from studies.standards.check import Check
    from studies.standards.page import page
    from studies.standards.table import by_name, candidate_of, print_checks

    if name is not None and name not in NAMES:
        raise NoSuchStandard(f"no standard named {name!r}; there are {', '.join(NAMES)}")
    # read before the first test: a wrong file must not be found out after a minute
    candidate = candidate_of(machine, equipment, changes or [])
    console = Console(highlight=False)
    wanted = [name] if name else list(NAMES)
    done = {}
    # results after all tests: the bar and the tables would overwrite one another
    for key in track(wanted, "standards", console=Console(stderr=True), transient=True):
        standard = by_name(key)
        done[key] = (standard, standard.perform(candidate))
    checks: list[Check] = []
    for standard, findings in done.values():
        print_checks(console, standard, findings)
        checks += findings.checks
    out.mkdir(parents=True, exist_ok=True)
    file = out / "standards.html"
    file.write_text(page(candidate, done), encoding="utf-8")
    console.print(f"page: {file}", soft_wrap=True)
    raise typer.Exit(ending_of(check.result for check in checks if check.result is not None))


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command(epilog=EPILOG)(standards)
