"""`loaderhil export-a2l`: the description of the ECU for measuring and calibrating tools."""

from pathlib import Path
from typing import Annotated

import typer

from ecu.measure.channel import EXAMPLE


def export_a2l(
    out: Annotated[Path, typer.Argument(metavar="FILE", help="A2L file to write; an older one is replaced.")],
    calibration: Annotated[
        str,
        typer.Option(
            "--calibration",
            metavar="NAME|FILE",
            help="Calibration that the ECU works with: l60, compact, or a .toml file.",
        ),
    ] = "l60",
    xcp: Annotated[
        str,
        typer.Option(
            "--xcp",
            metavar="TOOL,ECU",
            help="CAN identifiers of tool and ECU, as given to `loaderhil ecu --xcp`.",
        ),
    ] = EXAMPLE,
) -> None:
    """Write the A2L file of the ECU: everything that a tool can measure and calibrate by XCP, with addresses and ranges.

    Exit code 0: written; 2: the calibration, the identifiers or the file cannot be used. Example: `loaderhil export-a2l out/l60.a2l`
    """
    from dbc import loader_database
    from deploy.a2l.document import write_a2l
    from ecu.calibration import load_calibration
    from ecu.measure.channel import Channel

    name = load_calibration(calibration).name
    text = write_a2l(name, Channel.parse(xcp, loader_database()))
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(text, encoding="utf-8")
    print(f"written: {out}")


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("export-a2l")(export_a2l)
