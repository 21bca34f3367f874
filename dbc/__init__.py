"""The DBC files of the bench, and conversion between frames and physical values, for plant, ECU and every tool."""

from functools import cache
from pathlib import Path

from dbc.database import Database

FOLDER = Path(__file__).resolve().parent


@cache
def loader_database() -> Database:
    """loader.dbc: the bus between machine and ECU."""
    return Database.from_file(FOLDER / "loader.dbc")


@cache
def reference_database() -> Database:
    """reference.dbc: the test instrumentation, which the ECU never sees."""
    return Database.from_file(FOLDER / "reference.dbc")
