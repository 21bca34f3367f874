"""Writes values into the text of a TOML file. Comments and order stay, which no TOML writer of the standard library can do."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass

_BARE = re.compile(r"[A-Za-z0-9_-]+$")


@dataclass(frozen=True, slots=True)
class Line:
    """One value of a table, with a comment behind it."""

    table: tuple[str, ...]  # ("effects", "grade") is [effects.grade]
    key: str
    value: float  # in the unit that the key states
    comment: str


def quoted(name: str) -> str:
    """A name as a TOML key."""
    return name if _BARE.match(name) else json.dumps(name, ensure_ascii=False)


def header(table: Sequence[str]) -> str:
    """The heading of a table: '[effects."road grade"]'."""
    return f"[{'.'.join(quoted(part) for part in table)}]"


def number(value: float) -> str:
    """A float that TOML reads back to the last bit."""
    return repr(float(value))


def with_values(text: str, lines: Sequence[Line]) -> str:
    """The text with every value set in its table; missing tables and keys are added."""
    rows = text.rstrip("\n").split("\n")
    for line in lines:
        row = f"{quoted(line.key)} = {number(line.value)}  # {line.comment}"
        start = _table_at(rows, line.table)
        if start is None:
            rows += ["", header(line.table), row]
            continue
        end = _end_of(rows, start)
        at = next((i for i in range(start + 1, end) if _sets(rows[i], line.key)), None)
        if at is None:
            rows.insert(end, row)
        else:
            rows[at] = row
    return "\n".join(rows) + "\n"


def _table_at(rows: Sequence[str], table: Sequence[str]) -> int | None:
    wanted = header(table)
    return next((i for i, row in enumerate(rows) if _begins(row, wanted, "#")), None)


def _begins(row: str, wanted: str, then: str) -> bool:
    """Whether a row starts with `wanted`, followed by nothing or by `then`. A plain prefix test would take [a.bc] for [a.b]."""
    row = row.strip()
    rest = row.removeprefix(wanted).lstrip()
    return row.startswith(wanted) and (rest.startswith(then) or (not rest and then == "#"))


def _end_of(rows: Sequence[str], start: int) -> int:
    """Index of the row behind the last value of a table: comments before the next heading belong to the next table."""
    following = (i for i in range(start + 1, len(rows)) if rows[i].lstrip().startswith("["))
    end = next(following, len(rows))
    while not rows[end - 1].strip() or rows[end - 1].lstrip().startswith("#"):
        end -= 1
    return end


def _sets(row: str, key: str) -> bool:
    """Whether a row gives the key a value, however the key is quoted."""
    return any(_begins(row, form, "=") for form in (quoted(key), json.dumps(key, ensure_ascii=False)))
