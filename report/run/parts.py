"""Pieces of markup that several chapters of the report share."""

from collections.abc import Iterable, Sequence
from html import escape

from hil.verdict import Verdict

Columns = Sequence[tuple[str, str]]
"""Markup per run, under the run's name."""


def verdict_list(found: Sequence[Verdict]) -> str:
    """Results with their questions and reasons."""
    rows = "".join(
        f'<li class="{v.result.name.lower()}"><b>{v.result.value}</b><span>{escape(v.question)}: '
        f"{escape(v.reason)}</span></li>"
        for v in found
    )
    return f'<ul class="verdicts">{rows}</ul>' if rows else ""


def columns(parts: Columns) -> str:
    """Runs side by side; a lone run takes the width."""
    shown = "".join(
        f'<div><p class="run">{escape(name)}</p>{markup}</div>' for name, markup in parts if markup
    )
    return f'<div class="columns">{shown}</div>' if shown else ""


def table(
    head: Sequence[str], rows: Iterable[Sequence[str]], numbers_from: int = 99, kind: str = "table"
) -> str:
    """A table; columns from `numbers_from` on hold numbers."""

    def cell(i: int, value: str, tag: str) -> str:
        scope = ' scope="col"' if tag == "th" else ""
        kind = ' class="n"' if i >= numbers_from else ""
        return f"<{tag}{scope}{kind}>{escape(value)}</{tag}>"

    header = "".join(cell(i, value, "th") for i, value in enumerate(head))
    body = "".join(
        "<tr>" + "".join(cell(i, value, "td") for i, value in enumerate(row)) + "</tr>" for row in rows
    )
    return f'<div class="{kind}" tabindex="0"><table><thead><tr>{header}</tr></thead><tbody>{body}</tbody></table></div>'
