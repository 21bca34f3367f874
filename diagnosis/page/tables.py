"""Tables and lists of definitions as markup."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

from diagnosis.page.heat import breakable, level


@dataclass(frozen=True, slots=True)
class Cell:
    """Markup of one cell and its class."""

    markup: str
    style: str = ""


def plain(text: str, style: str = "") -> Cell:
    """Text; names may be broken after an underscore."""
    return Cell(breakable(text), style)


def meter(share: float) -> Cell:
    """A share as a number and a bar."""
    width = 100 * min(max(share, 0.0), 1.0)
    bar = f'<span class="meter" aria-hidden="true"><i style="width:{width:.0f}%"></i></span>'
    return Cell(f"{round(100 * share)} %{bar}", "n")


def heat(*values: float | None) -> Cell:
    """Residuals in one-step errors with their colours: one, or before and after."""
    told = [f'{value:.2f}<i class="h{level(value)}"></i>' for value in values if value is not None]
    return Cell(" → ".join(told) or "–", "heatcell")


def table(head: Sequence[str], rows: Sequence[Sequence[Cell]], numbers: Sequence[int] = ()) -> str:
    """A table that scrolls by itself where the page is narrow; numbers: columns whose heading stands right."""
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
    """Terms with what they are."""
    return f"<dl>{''.join(f'<dt>{escape(k)}</dt><dd>{escape(v)}</dd>' for k, v in facts.items())}</dl>"
