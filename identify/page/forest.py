"""A forest plot: the interval of each parameter over that of its prior, all in standard deviations of the prior from the sheet."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

SPAN = 4.0  # standard deviations of the prior on either side; an interval beyond it ends at the edge
ROW = 22  # height of a row
LABEL, WIDTH = 320, 480  # of the names and of the plot, in units of the drawing
EDGE = 12  # right of the plot, for the half of its last number

STYLE = """
.forest text { font-size: 12px; fill: currentColor; } .forest .zero { stroke: currentColor; opacity: .4; }
.forest .prior { stroke: currentColor; opacity: .22; stroke-width: 9; } .forest .interval { stroke: var(--estimate); stroke-width: 3; }
.forest .point { fill: var(--estimate); } .forest .open { opacity: .45; } .forest .axis { opacity: .6; }
"""


@dataclass(frozen=True, slots=True)
class Row:
    """One parameter; all in standard deviations of its prior from the value of the sheet."""

    label: str
    value: float
    lower: float
    upper: float
    prior: tuple[float, float]  # its 95 % interval
    determined: bool


def forest(rows: Sequence[Row]) -> str:
    """A <figure>; empty without rows."""
    if not rows:
        return ""
    height = ROW * (len(rows) + 1)
    ticks = range(-int(SPAN), int(SPAN) + 1)
    axis = "".join(
        f'<text class="axis" x="{_x(t):.1f}" y="{height - 6}" text-anchor="middle">{t:+d}</text>'
        for t in ticks
    )
    words = "; ".join(f"{r.label} {r.value:+.2f} ({r.lower:+.2f} to {r.upper:+.2f})" for r in rows)
    return (
        '<figure class="plot"><figcaption>Difference from the sheet <span class="unit">[standard deviations of the prior]</span></figcaption>'
        f'<svg class="forest" viewBox="0 0 {LABEL + WIDTH + EDGE} {height}" role="img" aria-label="{escape(words)}">'
        f'<line class="zero" x1="{_x(0.0):.1f}" x2="{_x(0.0):.1f}" y1="0" y2="{height - ROW}"/>'
        f"{''.join(_row(i, r) for i, r in enumerate(rows))}{axis}</svg>"
        "<p>Wide and pale: 95 % before the drives. Narrow: 95 % after them. Faint rows are not determined by these drives.</p></figure>"
    )


def _row(number: int, r: Row) -> str:
    y = ROW * number + ROW // 2
    kind = "" if r.determined else ' class="open"'
    return (
        f'<g{kind}><text x="{LABEL - 10}" y="{y + 4}" text-anchor="end">{escape(r.label)}</text>'
        f'<line class="prior" x1="{_x(r.prior[0]):.1f}" x2="{_x(r.prior[1]):.1f}" y1="{y}" y2="{y}"/>'
        f'<line class="interval" x1="{_x(r.lower):.1f}" x2="{_x(r.upper):.1f}" y1="{y}" y2="{y}"/>'
        f'<circle class="point" cx="{_x(r.value):.1f}" cy="{y}" r="4"/></g>'
    )


def _x(value: float) -> float:
    share = (min(max(value, -SPAN), SPAN) + SPAN) / (2.0 * SPAN)
    return LABEL + share * WIDTH
