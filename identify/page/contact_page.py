"""The page of a tyre's vertical stiffness and contact patch."""

from collections.abc import Mapping, Sequence
from html import escape

import numpy as np

from identify.page.figure import STYLE, Cloud, Line, drawn, table
from identify.tyre.patch import Fitted
from report.kit.document import bar, document

MEANINGS = {
    "qfz1": "vertical stiffness, times radius over nominal load",
    "qfz2": "the same, squared",
    "qa1": "half length over radius, with the square root of the load",
    "qa2": "the same, with the load",
    "qb1": "half width over radius, with the cube root of the load",
    "qb2": "the same, with the load",
}


def contact_page(
    name: str,
    found: Mapping[str, Fitted],
    at_nominal: Mapping[str, tuple[float, float, str]],
    *,
    warnings: Sequence[str],
    origin: str,
) -> str:
    """The whole page."""
    rows = [
        (key, MEANINGS[key], f"{i.value:.5g}", f"{i.lower:.5g} to {i.upper:.5g}")
        for f in found.values()
        for which, key in enumerate(f.law.coefficients)
        for i in [f.interval(which)]
    ]
    said = [
        (what, f"{value:.4g} {unit}", f"{value - half:.4g} to {value + half:.4g} {unit}")
        for what, (value, half, unit) in at_nominal.items()
    ]
    chapters = [
        ("result", "Parameters", table(("parameter", "meaning", "value", "95 % interval"), rows)),
        ("nominal", "At nominal load", table(("", "value", "95 % interval"), said)),
        (
            "laws",
            "Laws and readings",
            f'<div class="columns">{"".join(_drawing(f) for f in found.values())}</div>',
        ),
    ]
    listed = "".join(f"<li>{escape(w)}</li>" for w in warnings)
    head = f"<h1>{escape(name)}</h1><p>{max(f.x.size for f in found.values())} loads</p>"
    head += f'<ul class="problems">{listed}</ul>' if listed else ""
    return document(
        title=f"Contact of {name}",
        kicker="Identification: contact patch and vertical stiffness",
        head=head,
        chapters=chapters,
        footer=origin,
        aside=bar(),
        style=STYLE,
    )


def _drawing(f: Fitted) -> str:
    span = np.linspace(0.0, 1.1 * float(f.x.max()), 200)
    rows = f.law.rows(span)
    middle = rows @ f.coefficients
    half = f.quantile * np.sqrt(np.einsum("ij,jk,ik->i", rows, f.covariance, rows))
    line = Line(name="law, 95 %", across=span, upward=middle, lower=middle - half, upper=middle + half)
    unit = f.law.upward
    return drawn(
        f.law.title,
        f.law.across,
        unit[unit.index("[") + 1 : -1],
        [Cloud(name="readings", across=f.x, upward=f.value)],
        [line],
    )
