"""What `loaderhil decode` takes and gives: DBC files, and the tables' formats, places and errors."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path

from bus.frame import EXTENDED
from bus.user_error import UserError
from dbc import FOLDER
from dbc.database import Database
from dbc.j1939 import pgn
from dbc.protections import Protection, ProtectionError

DEFAULT_DBCS = ("loader.dbc", "reference.dbc", "j1939.dbc")


class Format(StrEnum):
    """The file format of the tables."""

    CSV = "csv"
    PARQUET = "parquet"


class TableError(UserError, OSError):
    """A table cannot be written; the message names the file and the cause."""


@contextmanager
def naming_the_file(target: Path) -> Iterator[None]:
    """Turn an OSError while `target` is written into a TableError that names the file.

    The error of write(2) on a full disk names no file.
    """
    try:
        yield
    except OSError as error:
        raise TableError(f"{target}: cannot be written: {error.strerror or error}") from error


def load_databases(files: Iterable[Path], *, j1939: bool = False) -> list[Database]:
    """The DBC files in the order given; without any, our own and a few J1939 groups.

    j1939: every message with a 29-bit identifier stands for its parameter group, marked so or not.
    """
    named = list(files) or [FOLDER / name for name in DEFAULT_DBCS]
    databases = [Database.from_file(file, strict=False) for file in named]
    for database in databases if j1939 else ():
        extended = [codec for codec in database.by_id.values() if codec.can_id & EXTENDED]
        database.by_pgn = {pgn(codec.can_id): codec for codec in reversed(extended)}
    return databases


def protect(databases: Sequence[Database], protections: Mapping[str, Protection]) -> None:
    """Give each protection to the first DBC that has its message; ProtectionError if none has."""
    for name, each in protections.items():
        found = next((database for database in databases if name in database.by_name), None)
        if found is None:
            raise ProtectionError(f"PROTECTIONS: no DBC has a message {name!r}")
        found.protect_with({name: each})


def target_of(out: Path, log: Path, message: str, form: Format, *, several: bool) -> Path:
    """Where a message's table goes: in a folder per recording when there are several."""
    stem = log.name.removesuffix(".gz")
    for suffix in (".log", ".candump", ".blf", ".asc", ".mf4"):
        stem = stem.removesuffix(suffix)
    return (out / stem if several else out) / f"{message}.{form}"
