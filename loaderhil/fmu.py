"""`loaderhil export-fmu`: writes the plant as an FMU."""

from pathlib import Path
from typing import Annotated

import typer


def export_fmu(
    out: Annotated[Path, typer.Argument(metavar="FILE.fmu", help="File to write; an older one is replaced.")],
    machine: Annotated[
        str | None,
        typer.Option("--machine", metavar="NAME|FILE", help="Machine; by default the scenario's, else l60."),
    ] = None,
    scenario: Annotated[
        str | None,
        typer.Option(
            "--scenario",
            metavar="SCENARIO",
            help="Take payload, ground and start from this scenario, as start values of the FMU's parameters.",
        ),
    ] = None,
    fmi: Annotated[int, typer.Option("--fmi", min=2, max=3, help="Version of FMI: 2 or 3.")] = 2,
) -> None:
    """Write the simulated machine as an FMU for co-simulation: commands to its actuators in, its motion out.

    The importing computer needs Linux on x86-64 and a Python with loaderhil: the exporting one, or that of $LOADERHIL_PYTHON.
    Example: `loaderhil export-fmu machine.fmu --scenario loaded`, then `loaderhil run loaded --plant machine.fmu`
    """
    from fmi.archive import FmuError
    from fmi.export import export, starts_of
    from plant.unit.scenario import load_scenario

    if out.suffix != ".fmu":
        raise FmuError(f"{out}: must end in .fmu")
    starts: dict[str, float] = {}
    if scenario is not None:
        loaded = load_scenario(Path(scenario) if scenario.endswith(".toml") else scenario)
        starts, machine = starts_of(loaded), machine or loaded.machine
    export(machine or "l60", out, 3 if fmi == 3 else 2, starts)
    print(f"written: {out}")


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(export_fmu)
