"""`loaderhil export-c`: the ECU as C99 for a microcontroller."""

from pathlib import Path
from typing import Annotated

import typer


def export_c(
    out: Annotated[Path, typer.Argument(metavar="DIR", help="Folder to write; made if it does not exist.")],
    calibration: Annotated[
        str,
        typer.Option(
            "--calibration", metavar="NAME", help="Calibration of the machine: l60, compact, or a .toml file."
        ),
    ] = "l60",
) -> None:
    """Write the ECU as C99 for a microcontroller: single precision, no heap; with builds for Linux and a Cortex-M4F.

    Exit code 0: written; 2: the calibration or the folder cannot be used. Example: `loaderhil export-c out/c --calibration l60`
    """
    from deploy.c.project import write_project
    from ecu.calibration import calibration_table, read_calibration

    table = calibration_table(calibration)
    files = write_project(out, read_calibration(table), table.values)
    for file in files:
        print(f"written: {file}")


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("export-c")(export_c)
