"""`loaderhil scenarios`, `report` and `campaign`: the options of these commands."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from loaderhil.options import EcuCoreOption, checked_core

if TYPE_CHECKING:
    from hil.results import Suite

# a process per processor: simulations of a campaign share nothing and never wait
JobsOption = Annotated[
    int | None, typer.Option("--jobs", min=1, help="Number of processes; by default one per processor.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the verdicts as JSON.")]
JunitOption = Annotated[
    Path | None, typer.Option("--junit", metavar="FILE", help="Write the verdicts as JUnit XML.")
]
ResultsOption = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the table.")]


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.command()(scenarios)
    app.command()(report)
    # a group: each campaign writes another page, and their options have little in common
    campaign = typer.Typer(
        no_args_is_help=True, help="Run many simulations and write their results as one table."
    )
    campaign.command("normal-force")(campaign_normal_force)
    campaign.command("roll-over")(campaign_roll_over)
    campaign.command("prevention")(campaign_prevention)
    campaign.command("calibration")(campaign_calibration)
    app.add_typer(campaign, name="campaign")


def scenarios(
    files: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[FILE]...", help="Scenario files to check instead of listing."),
    ] = None,
) -> None:
    """List the scenarios that come with loaderhil, or check scenario files.

    A check reads the files without running them. Example: `loaderhil scenarios wet_bend.toml`
    """
    from loaderhil.tables import show_scenarios

    show_scenarios(files or [])


def report(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN...", help="Run directories.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="HTML file to write.")] = Path(
        "out/report.html"
    ),
) -> None:
    """Write one self-contained HTML page about one or more runs.

    Example: `loaderhil report out/loaded out/unloaded --out both.html`
    """
    from report.run import write_report

    print(write_report(runs, out))


def campaign_normal_force(
    out: ResultsOption = Path("docs/results"),
    jobs: JobsOption = None,
    as_json: JsonOption = False,
    junit: JunitOption = None,
) -> None:
    """Compare estimated and true normal forces in every scenario, for both forms of the estimators.

    The exit code is 1 when the corrected form misses its target in a scenario.
    """
    from studies.campaigns.normal_force import run_campaign

    _give("normal-force", *run_campaign(out, jobs), as_json, junit)


def campaign_roll_over(
    out: ResultsOption = Path("docs/results"),
    jobs: JobsOption = None,
    extended: Annotated[
        bool,
        typer.Option(
            "--extended", help="Drive on grades, banks and slippery ground instead of level ground."
        ),
    ] = False,
    ecu_core: EcuCoreOption = "auto",
    as_json: JsonOption = False,
    junit: JunitOption = None,
) -> None:
    """Measure warnings before lift-off, and prevented roll-overs, over a grid of speed, payload and articulation rate.

    The exit code is 1 when a lift-off is not announced or not prevented, or a warning has no reason.
    """
    from studies.campaigns import roll_over, roll_over_extended

    file, suites = (roll_over_extended if extended else roll_over).run_campaign(
        out, jobs, checked_core(ecu_core)
    )
    _give("roll-over", file, suites, as_json, junit)


def campaign_prevention(
    out: ResultsOption = Path("docs/results"),
    jobs: JobsOption = None,
    runs: Annotated[int, typer.Option("--runs", min=1, help="Number of drives.")] = 1000,
    seed: Annotated[
        int | None,
        typer.Option(
            "--seed",
            min=0,
            help="Draws the drives and their calibrations. Default: that of the published page.",
            show_default=False,
        ),
    ] = None,
    ecu_core: EcuCoreOption = "auto",
    as_json: JsonOption = False,
    junit: JunitOption = None,
) -> None:
    """Drive random manoeuvres with the limits on, half of them with a wrong calibration, and explain every wheel that lifts.

    The exit code is 1 when a wheel lifts that a limit could have kept down. An interrupted campaign goes on where it stopped.
    """
    from studies.campaigns.prevention import SEED, run_campaign

    # its arms are stored one by one, so that Ctrl-C loses only those that were running
    file, suite = run_campaign(
        out, runs=runs, seed=SEED if seed is None else seed, jobs=jobs, core=checked_core(ecu_core)
    )
    _give("prevention", file, [suite], as_json, junit)


def campaign_calibration(
    out: ResultsOption = Path("docs/results"),
    jobs: JobsOption = None,
    calibrations: Annotated[
        int, typer.Option("--calibrations", min=1, help="Number of wrong calibrations.")
    ] = 100,
    turns: Annotated[int, typer.Option("--turns", min=0, help="Turns of the roll-over grid.")] = 40,
    seed: Annotated[
        int, typer.Option("--seed", min=0, help="Of the first calibration, and of the turns.")
    ] = 1,
    as_json: JsonOption = False,
    junit: JunitOption = None,
) -> None:
    """Estimate with calibrations that are wrong as real ones are: normal forces, payload, warnings, false alarms.

    The exit code is 1 when the aims are missed. An interrupted campaign goes on where it stopped.
    """
    from studies.campaigns.calibration import run_campaign

    file, suites = run_campaign(out, count=calibrations, some_turns=turns, seed=seed, jobs=jobs)
    _give("calibration", file, suites, as_json, junit)


def _give(name: str, page: Path, suites: "Sequence[Suite]", as_json: bool, junit: Path | None) -> None:
    """Print a campaign's results, and end with their exit code."""
    from hil.results import as_json as json_of
    from hil.results import ending_of, write_junit

    ending = ending_of(case.result for suite in suites for case in suite.cases)
    if junit is not None:
        write_junit(junit, f"campaign {name}", suites)
    # the path alone, or JSON alone: both are read by scripts
    print(json_of(f"campaign {name}", ending, suites, page=str(page)) if as_json else page)
    raise typer.Exit(ending)
