"""Reads arrays of tables that each have a `kind`, such as [[fault]] and [[expect]], for the readers of those tables."""

import difflib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

from configuration.table import CheckedTable

Read = TypeVar("Read")
Reader = TypeVar("Reader")


def tables_of(
    file: Path, key: str, read: Callable[[CheckedTable], Read], *, alone: bool, plural: str
) -> tuple[Read, ...]:
    """What `read` makes of each [[key]] table of a TOML file, in the order of the file.

    alone: the file holds such tables and nothing else, and at least one; otherwise it is a scenario, which may have
    none. plural: what errors call the tables. ConfigurationError names file, key, value, unit and range.
    """
    table = CheckedTable.from_file(file)
    found = tuple(read(each) for each in table.tables(key))
    if alone:
        # an empty file is refused: the user named it, so a misspelt key must not pass as "nothing to do"
        if not found:
            raise table.error(key, f"is missing: a file of {plural} has [[{key}]] tables")
        # keys of a scenario are left to its own reader, but here nobody else would look at them
        table.finish()
    return found


def reader_of(
    table: CheckedTable, kinds: Mapping[str, Reader], noun: str, renamed: Mapping[str, str] | None = None
) -> Reader:
    """The entry of `kinds` that the table's `kind` names. ConfigurationError, with a hint, for an unknown kind.

    noun: what errors call it, such as "fault". renamed: old names -> names in `kinds`; errors do not suggest them.
    """
    kind = table.text("kind")
    kind = (renamed or {}).get(kind, kind)
    if kind not in kinds:
        near = difflib.get_close_matches(kind, kinds, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(kinds)}"
        raise table.error("kind", f"= {kind!r} is no kind of {noun}; {hint}")
    return kinds[kind]
