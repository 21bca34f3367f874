"""Options that several testing commands share: the DBC, and protections of the user's own."""

from pathlib import Path
from typing import Annotated

import typer

from dbc import FOLDER
from dbc.database import Database
from dbc.protections import read_protections

DbcOption = Annotated[
    Path, typer.Option("--dbc", metavar="FILE", help="DBC file; by default that of machine and ECU.")
]
ProtectionOption = Annotated[
    Path | None,
    typer.Option(
        "--protection",
        metavar="FILE",
        help="Python file with counters and checksums that the DBC cannot describe: PROTECTIONS = {MESSAGE: OBJECT}.",
    ),
]
LOADER = FOLDER / "loader.dbc"


def database_of(dbc: Path, protection: Path | None) -> Database:
    """The DBC with the user's protections in it."""
    database = Database.from_file(dbc)
    if protection is not None:
        # after the DBC's own: what the user says of a message replaces what its attributes say
        database.protect_with(read_protections(protection))
    return database
