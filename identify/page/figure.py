"""Drawings of one quantity over another: points, rejected points, curves with their bands. Axes and paths are those of report/kit."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import NDArray

from report.kit.axis import Axis, around, number
from report.kit.plot import UNITS, Curve, path, x

Array = NDArray[np.float64]

MOST_POINTS = 1500  # of a cloud: more cannot be distinguished by eye and cost megabytes

STYLE = """
.xy circle { stroke: none; fill: var(--demand); opacity: .55; } .xy circle.rejected { fill: var(--lifted); opacity: .9; }
.xy path.band { fill: var(--estimate); stroke: none; opacity: .18; } .xy .dot { border-radius: 50%; width: .6rem; height: .6rem; border: 0; background: var(--demand); }
.xy .dot.rejected { background: var(--lifted); } .xy svg { overflow: visible; } .xy path.estimate { stroke-width: 2; }
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cloud:
    """Points (n,), NaN is none. rejected: drawn as such."""

    name: str
    across: Array
    upward: Array
    rejected: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A curve (n,) over ascending values, with the edges of its band where it has one. style: a class of the style sheet."""

    name: str
    across: Array
    upward: Array
    style: str = "estimate"
    lower: Array | None = None
    upper: Array | None = None


def drawn(
    title: str, across: str, unit: str, clouds: Sequence[Cloud] = (), lines: Sequence[Line] = ()
) -> str:
    """A <figure>; across: name and unit of the horizontal axis; unit: of the vertical one."""
    shown: list[Cloud | Line] = [*clouds, *lines]
    if not any(np.isfinite(c.across).any() for c in shown):
        return ""
    right = around([c.across for c in shown])
    up = around(
        [c.upward for c in shown]
        + [edge for line in lines for edge in (line.lower, line.upper) if edge is not None]
    )
    body = "".join(_band(line, right, up) for line in lines) + "".join(
        path(Curve(line.name, line.across, line.upward, line.style), right, up) for line in lines
    )
    grid = "".join(f"M0 {UNITS - round(UNITS * float(up.share(t)))}h{UNITS}" for t in up.ticks(5)) + "".join(
        f"M{x(right, t)} 0v{UNITS}" for t in right.ticks(8)
    )
    points = "".join(_points(cloud, right, up) for cloud in clouds)
    labels = "".join(f'<span style="bottom:{up.percent(t)}">{number(t)}</span>' for t in up.ticks(5))
    below = "".join(f'<span style="left:{right.percent(t)}">{number(t)}</span>' for t in right.ticks(8))
    legend = "".join(
        f'<li><i class="dot{" rejected" if c.rejected else ""}"></i>{escape(c.name)}</li>' for c in clouds
    )
    legend += "".join(f'<li class="{line.style}"><i></i>{escape(line.name)}</li>' for line in lines)
    words = f"{title}: {unit} over {across}; " + ", ".join(c.name for c in shown)
    return (
        f'<figure class="plot xy"><figcaption>{escape(title)} <span class="unit">[{escape(unit)}]</span></figcaption><div class="chart">'
        f'<div class="y" aria-hidden="true">{labels}</div><div class="area" role="img" aria-label="{escape(words)}">'
        f'<svg viewBox="0 0 {UNITS} {UNITS}" preserveAspectRatio="none" aria-hidden="true"><path class="grid" d="{grid}"/>{body}</svg>'
        f'<svg aria-hidden="true">{points}</svg></div><div class="x" aria-hidden="true"><div>{below}</div><em>{escape(across)}</em></div></div>'
        f'<ul class="legend">{legend}</ul></figure>'
    )


def _points(cloud: Cloud, right: Axis, up: Axis) -> str:
    good = np.flatnonzero(np.isfinite(cloud.across) & np.isfinite(cloud.upward))
    shown = good[:: max(1, good.size // MOST_POINTS)]
    kind = ' class="rejected"' if cloud.rejected else ""
    places = zip(
        100.0 * right.share(cloud.across[shown]), 100.0 * (1.0 - up.share(cloud.upward[shown])), strict=True
    )
    return "".join(f'<circle{kind} r="1.6" cx="{a:.2f}%" cy="{b:.2f}%"/>' for a, b in places)


def _band(line: Line, right: Axis, up: Axis) -> str:
    if line.lower is None or line.upper is None:
        return ""
    a = np.rint(UNITS * right.share(line.across)).astype(int)
    low, high = (np.rint(UNITS * (1.0 - up.share(v))).astype(int) for v in (line.lower, line.upper))
    there = [f"{u} {v}" for u, v in zip(a.tolist(), high.tolist(), strict=True)]
    back = [f"{u} {v}" for u, v in zip(a[::-1].tolist(), low[::-1].tolist(), strict=True)]
    return f'<path class="band" d="M{"L".join([*there, *back])}z"/>'


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of texts; cells that are numbers stand right."""
    if not rows:
        return ""

    def cell(text: str) -> str:
        kind = ' class="n"' if text[:1].isdigit() or text[:1] in "−-+" else ""
        return f"<td{kind}>{escape(text)}</td>"

    top = "".join(f"<th>{escape(h)}</th>" for h in head)
    body = "".join(f"<tr>{''.join(cell(c) for c in row)}</tr>" for row in rows)
    return f'<div class="table" tabindex="0"><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'
