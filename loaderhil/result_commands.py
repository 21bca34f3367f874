"""`loaderhil scenarios`, `report` and `campaign`: the options of these commands."""

from pathlib import Path
from typing import Annotated

import typer

# a process per processor: simulations of a campaign share nothing and never wait
JobsOption = Annotated[
    int | None, typer.Option("--jobs", min=1, help="Number of processes; by default one per processor.")
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


def campaign_normal_force(out: ResultsOption = Path("docs/results"), jobs: JobsOption = None) -> None:
    """Compare estimated and true normal forces in every scenario, for both forms of the estimators."""
    from studies.campaigns.normal_force import run_campaign

    print(run_campaign(out, jobs))


def campaign_roll_over(
    out: ResultsOption = Path("docs/results"),
    jobs: JobsOption = None,
    extended: Annotated[
        bool,
        typer.Option(
            "--extended", help="Drive on grades, banks and slippery ground instead of level ground."
        ),
    ] = False,
) -> None:
    """Measure warnings before lift-off, and prevented roll-overs, over a grid of speed, payload and articulation rate."""
    from studies.campaigns import roll_over, roll_over_extended

    print((roll_over_extended if extended else roll_over).run_campaign(out, jobs))


def campaign_prevention(
    out: ResultsOption = Path("docs/results"),
    jobs: JobsOption = None,
    runs: Annotated[int, typer.Option("--runs", min=1, help="Number of drives.")] = 1000,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Draws the drives and their calibrations.")] = 1,
    as_json: Annotated[bool, typer.Option("--json", help="Print the verdicts as JSON.")] = False,
    junit: Annotated[
        Path | None, typer.Option("--junit", metavar="FILE", help="Write the verdicts as JUnit XML.")
    ] = None,
) -> None:
    """Drive random manoeuvres with the limits on, half of them with a wrong calibration, and explain every wheel that lifts.

    The exit code is 1 when a wheel lifts that a limit could have kept down. An interrupted campaign goes on where it stopped.
    """
    from hil.results import as_json as json_of
    from hil.results import write_junit
    from studies.campaigns.prevention import ending_of, run_campaign

    # its arms are stored one by one, so that Ctrl-C loses only those that were running
    file, suite = run_campaign(out, runs=runs, seed=seed, jobs=jobs)
    ending = ending_of(suite)
    if junit is not None:
        write_junit(junit, "campaign prevention", [suite])
    # the path alone, or JSON alone: both are read by scripts
    print(json_of("campaign prevention", ending, [suite], page=str(file)) if as_json else file)
    raise typer.Exit(ending)
