"""Markup of tables and definition lists, for the diagnosis page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

from diagnosis.page.heat import breakable, level


@dataclass(frozen=True, slots=True)
class Cell:
    """One cell of a table."""

    markup: str
    style: str = ""  # class of the style sheet


def plain(text: str, style: str = "") -> Cell:
    """Text; names may be broken after an underscore."""
    return Cell(breakable(text), style)


def meter(share: float) -> Cell:
    """A share as a number and a bar."""
    width = 100 * min(max(share, 0.0), 1.0)
    bar = f'<span class="meter" aria-hidden="true"><i style="width:{width:.0f}%"></i></span>'
    return Cell(f"{round(100 * share)} %{bar}", "n")


def heat(*values: float | None) -> Cell:
    """A cell with residuals in one-step errors and their colours: one value, or before and after."""
    parts = [f'{value:.2f}<i class="h{level(value)}"></i>' for value in values if value is not None]
    return Cell(" → ".join(parts) or "–", "heatcell")


def table(head: Sequence[str], rows: Sequence[Sequence[Cell]], numbers: Sequence[int] = ()) -> str:
    """Markup of a table that scrolls on a narrow page; numbers: indices of columns that are aligned right."""
    header = "".join(
        f'<th scope="col"{" class=n" if i in numbers else ""}>{breakable(name)}</th>'
        for i, name in enumerate(head)
    )
    body = "".join("<tr>" + "".join(_cell(c) for c in row) + "</tr>" for row in rows)
    return f'<div class="table" tabindex="0"><table><thead><tr>{header}</tr></thead><tbody>{body}</tbody></table></div>'


def _cell(cell: Cell) -> str:
    style = f' class="{cell.style}"' if cell.style else ""
    return f"<td{style}>{cell.markup}</td>"


def definitions(facts: Mapping[str, str]) -> str:
    """A definition list of terms and their texts."""
    return f"<dl>{''.join(f'<dt>{escape(k)}</dt><dd>{escape(v)}</dd>' for k, v in facts.items())}</dl>"
