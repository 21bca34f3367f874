"""The page about two runs: what differs first, with both runs in one picture, then everything that was compared."""

from collections.abc import Sequence
from html import escape

import numpy as np

from hil.verdict import Result
from report.kit.axis import Axis
from report.kit.document import document
from report.kit.plot import Curve, Plot, Timeline, common_range, markup
from report.run.parts import table, verdict_list
from testbench.compare.compare import Difference, Kind

PICTURES = 12
"""Differences that get a picture; a page with all hundred signals would not be read."""


def page(names: tuple[str, str], found: Sequence[Difference]) -> str:
    """The whole document. names: of the two run directories."""
    broken = [each for each in found if each.result is Result.FAILED]
    counts = f"{len(found)} comparisons, {len(broken)} beyond their tolerance"
    chapters = [
        ("different", "What differs", verdict_list([each.verdict for each in broken])),
        (
            "pictures",
            "Both runs",
            "".join(_picture(names, each) for each in [b for b in broken if b.series][:PICTURES]),
        ),
        *((kind.name.lower(), kind.value.capitalize(), _chapter(kind, found)) for kind in Kind),
    ]
    return document(
        title=f"{names[0]} and {names[1]}",
        kicker="loaderhil compare",
        head=f'<h1>{escape(names[0])} and {escape(names[1])}</h1><p class="soft">{escape(counts)}.</p>',
        chapters=chapters,
        footer="Written by loaderhil.",
    )


def _picture(names: tuple[str, str], difference: Difference) -> str:
    """One plot with a curve per run."""
    assert difference.series is not None
    first, second = difference.series
    times = np.concatenate((first.time_s, second.time_s))
    if not times.size:
        return ""
    curves = [
        Curve(name, series.time_s, series.values, style, steps=difference.kind is not Kind.ESTIMATE)
        for name, series, style in zip(names, (first, second), ("truth", "predicted"), strict=True)
    ]
    plot = Plot(title=difference.name, unit="", curves=curves)
    end_s = float(times.max())
    return markup(plot, common_range([plot]), Timeline(Axis(0.0, end_s), end_s)) if plot.drawn else ""


def _chapter(kind: Kind, found: Sequence[Difference]) -> str:
    rows = [(each.name, each.result.value, each.reason) for each in found if each.kind is kind]
    return table(("", "verdict", "both runs"), rows) if rows else ""
