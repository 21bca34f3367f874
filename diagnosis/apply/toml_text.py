"""Values laid over the text of a TOML file: comments and order stay, each change says where it is from."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass

_BARE = re.compile(r"[A-Za-z0-9_-]+$")


@dataclass(frozen=True, slots=True)
class Line:
    """One value of a table and what is told of it, behind it or, where it is long, above it."""

    table: tuple[str, ...]
    key: str
    value: float
    told: str


def quoted(name: str) -> str:
    """A name as a TOML key."""
    return name if _BARE.match(name) else json.dumps(name, ensure_ascii=False)


def header(table: Sequence[str]) -> str:
    """'[effects."road grade"]'."""
    return f"[{'.'.join(quoted(part) for part in table)}]"


def number(value: float) -> str:
    """A float as TOML reads it, to the last bit."""
    return repr(float(value))


def laid_over(text: str, lines: Sequence[Line]) -> str:
    """The text with every value in its table; a table or key that is not there is added."""
    rows = text.rstrip("\n").split("\n")
    for line in lines:
        row = f"{quoted(line.key)} = {number(line.value)}  # {line.told}"
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
    """Whether a row is `wanted`, and behind it nothing or what begins with `then`."""
    row = row.strip()
    rest = row.removeprefix(wanted).lstrip()
    return row.startswith(wanted) and (rest.startswith(then) or (not rest and then == "#"))


def _end_of(rows: Sequence[str], start: int) -> int:
    """The row behind the last one of a table that is not empty."""
    following = (i for i in range(start + 1, len(rows)) if rows[i].lstrip().startswith("["))
    end = next(following, len(rows))
    while not rows[end - 1].strip() or rows[end - 1].lstrip().startswith("#"):
        end -= 1
    return end


def _sets(row: str, key: str) -> bool:
    """Whether a row gives the key a value, however the key is quoted."""
    return any(_begins(row, form, "=") for form in (quoted(key), json.dumps(key, ensure_ascii=False)))
