"""Mismatch over time: a row per channel, coloured by how many one-step errors the residual is large."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from discrepancy.signals.quantities import span
from discrepancy.signals.recording import Array
from report.kit.axis import Axis
from report.kit.plot import Timeline, canvas, events, marked, time_labels

# Residuals [one-step errors] at which a colour begins. Noise alone gives about 1, so the first colour begins somewhat above it;
# the steps are about geometric, because residuals of a wrong model spread over a decade.
LEVELS = (1.2, 1.5, 2.0, 3.0, 5.0, 8.0)


@dataclass(frozen=True, slots=True)
class HeatRow:
    """One channel of the map."""

    name: str
    edges_s: Array  # (n + 1,) on the page's time axis
    value: Array  # (n,) between the edges [one-step errors]; NaN is not drawn
    after: bool = False  # with the effects found; drawn below the row of the baseline


def level(value: float) -> int:
    """Number of the colour of a residual [one-step errors], 0 to len(LEVELS)."""
    return int(np.searchsorted(LEVELS, value, side="right"))


def markup(rows: Sequence[HeatRow], timeline: Timeline) -> str:
    """Markup of all rows over one time axis. It has the structure of the bench report's bands, so that the same script moves the cursor."""
    across = timeline.axis
    body = "".join(_row(row, across) for row in rows)
    return (
        f'<div class="bands heat" data-t="{across.start:.6g} {across.end:.6g}">'
        f'<div class="overlay">{canvas("", marked(timeline), across)}{events(timeline)}</div>'
        f'{body}<div class="band ends"><span></span>{time_labels(across)}</div></div>'
    )


def breakable(text: str) -> str:
    """Markup of a text in which a browser may break long names after an underscore."""
    return escape(text).replace("_", "_<wbr>")


def key() -> str:
    """Legend of the colours."""
    edges = ("0", *(f"{edge:g}" for edge in LEVELS))
    cells = "".join(
        f'<li><i class="h{i}"></i>{low}{f" to {edges[i + 1]}" if i < len(LEVELS) else " and more"}</li>'
        for i, low in enumerate(edges)
    )
    return f'<ul class="heatkey" aria-label="Root mean square residual in one-step errors">{cells}</ul>'


def _row(row: HeatRow, across: Axis) -> str:
    known = row.value[np.isfinite(row.value)]
    largest = f"{known.max():.1f}" if known.size else "–"
    label = f"{row.name}{', with the effects found' if row.after else ''}: up to {largest} one-step errors"
    cells = "".join(
        _cell(low, high, value, across)
        for low, high, value in zip(
            row.edges_s[:-1].tolist(), row.edges_s[1:].tolist(), row.value.tolist(), strict=True
        )
        if math.isfinite(value)
    )
    return (
        f'<div class="band{" after" if row.after else ""}"><span class="name">{breakable(row.name)}<output></output></span>'
        f'<div class="track" role="img" aria-label="{escape(label)}"><div class="moving">{cells}</div></div></div>'
    )


def _cell(low: float, high: float, value: float, across: Axis) -> str:
    left, width = 100 * float(across.share(low)), 100 * (high - low) / (across.end - across.start)
    return (
        f'<i class="h{level(value)}" style="left:{left:.3f}%;width:{width:.3f}%" '
        f'title="{span(low, high)}: {value:.1f}"><b>{value:.1f}</b></i>'
    )
