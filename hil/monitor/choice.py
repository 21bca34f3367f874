"""Turns command-line words into the buses or files to watch and the messages to show."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from bus.frame import EXTENDED_MASK
from hil.monitor.target import Target

if TYPE_CHECKING:
    from hil.monitor.messages import Messages


def watched(texts: Sequence[str], *, with_errors: bool) -> tuple[Target, ...]:
    """What to watch; with_errors: error frames too where no filter says otherwise, which candump leaves out."""
    targets = [Target.parse(text) for text in texts]
    return tuple(target.with_errors(EXTENDED_MASK) if with_errors else target for target in targets)


def names(texts: Sequence[str] | None) -> tuple[str, ...]:
    """Names from repeated options, each of which may hold several separated by commas."""
    return tuple(name.strip() for text in texts or [] for name in text.split(",") if name.strip())


def known_messages(
    files: Sequence[Path],
    messages: Sequence[str],
    senders: Sequence[str],
    signals: Sequence[str],
    *,
    protection: bool,
) -> "Messages":
    """The selected messages of the DBC files, by default those of the bench. Raises DatabaseError or SelectionError."""
    # imported late: `--raw` needs no DBC, and cantools takes half a second to load
    from dbc import FOLDER, loader_database, reference_database
    from dbc.database import Database
    from hil.monitor.messages import Messages, Selection

    if files:
        databases = [Database.from_file(file, strict=False) for file in files]
    else:
        j1939 = Database.from_file(FOLDER / "j1939.dbc", strict=False)
        databases = [loader_database(), reference_database(), j1939]
    wanted = Selection(messages=messages, senders=senders, signals=signals, protection=protection)
    return Messages(databases, wanted)
