"""Options that several commands of the diagnosis share."""

from pathlib import Path
from typing import Annotated

import typer

from diagnosis.sheet import Sheet

ModelOption = Annotated[
    str,
    typer.Option(
        "--model",
        metavar="NAME|FILE.py|FILE.fmu",
        help="ball, car, loader, printed-estimator, road, straight, a file that defines `model`, or an FMU for co-simulation.",
    ),
]
CompanionOption = Annotated[
    Path | None,
    typer.Option(
        "--fmu-config",
        metavar="FILE.toml",
        help="With an FMU: its companion file, with effects, bounds and sensors; by default FILE.toml beside FILE.fmu.",
    ),
]
SheetOption = Annotated[
    Sheet,
    typer.Option(
        "--sheet",
        help="How well the baseline's parameters are known: from a brochure (priors three times as wide), from a data sheet, or measured on this machine (a third).",
    ),
]
PartOption = Annotated[
    str | None, typer.Option("--part", metavar="PART", help="Which part of a published data set.")
]
ConstantOption = Annotated[
    list[str] | None,
    typer.Option(
        "--constant", metavar="NAME=VALUE", help="Constant of the recordings: `mass [g]=58`; may be repeated."
    ),
]
WithOption = Annotated[
    Path | None,
    typer.Option(
        "--with",
        metavar="FILE",
        help="Baseline from this file, as --apply writes it; for the loader any machine, by name or file, else that of its run.json.",
    ),
]
