"""The results of the tests of standards as one self-contained HTML page, with charts as SVG."""

import io
import math
from collections.abc import Mapping
from html import escape
from typing import Any

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot as plt

from report.kit.document import document
from studies.standards.check import Candidate, Chart, Check, Findings, Standard

SMALLEST = 5e-4  # smaller values are shown as 0
HEADINGS = ("", "measured", "permitted", "verdict", "source")


def figure(value: float, unit: str) -> str:
    """A measured or permitted value with three or four digits."""
    if math.isnan(value):
        return "not reached"
    if math.isinf(value):
        return "no rest"
    if abs(value) >= 1000.0:
        return f"{value:,.0f} {unit}".replace(",", " ")
    return f"{value:.4g} {unit}" if abs(value) >= SMALLEST else f"0 {unit}"


def row(check: Check, *, short: bool) -> tuple[str, str, str, str, str]:
    """The cells of a check: what, measured, permitted, verdict, source. short: only the source's name with its mark."""
    bound = check.bound
    if bound is None or check.result is None:
        return check.what, figure(check.measured, check.unit), "", "", ""
    return (
        check.what,
        figure(check.measured, check.unit),
        f"{bound.sense} {figure(bound.value, check.unit)}",
        check.result.value,
        bound.clause.mark if short else bound.clause.text,
    )


def page(candidate: Candidate, done: Mapping[str, tuple[Standard, Findings]]) -> str:
    """The whole document."""
    return document(
        title=f"Standards: {candidate.name}",
        kicker="loaderhil bench tests",
        head=f'<h1>{escape(f"Standards: {candidate.name}")}</h1><p class="soft">{escape(candidate.machine.name)}. A formula marked unverified was not '
        "read in its source: its verdict is indicative.</p>",
        chapters=[
            (standard.name, standard.title, _chapter(standard, findings))
            for standard, findings in done.values()
        ],
        footer="Written by loaderhil.",
    )


def _chapter(standard: Standard, findings: Findings) -> str:
    head = "".join(f"<th>{escape(name)}</th>" for name in HEADINGS)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row(check, short=False)) + "</tr>"
        for check in findings.checks
    )
    charts = "".join(drawing(chart) for chart in findings.charts)
    return (
        f"<p>{escape(standard.method)}</p>"
        f'<div class="table"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>{charts}'
    )


def drawing(chart: Chart) -> str:
    """A chart as an SVG element."""
    with plt.rc_context({"svg.fonttype": "none", "svg.hashsalt": chart.title, "font.size": 9}):
        drawn, axes = plt.subplots(figsize=(9.0, 3.6), layout="constrained")
        _draw(axes, chart)
        out = io.StringIO()
        drawn.savefig(out, format="svg", metadata={"Date": None})
        plt.close(drawn)
    text = out.getvalue()
    # from <svg on: a declaration of XML has no place inside HTML
    return f"<figure><figcaption>{escape(chart.title)}</figcaption>{text[text.index('<svg') :]}</figure>"


def _draw(axes: Any, chart: Chart) -> None:
    for line in chart.lines:
        look = {"linestyle": "--", "color": "#666666"} if line.dashed else {}
        axes.plot(line.x, line.y, label=line.name or None, linewidth=1.4, **look)
    axes.set_xlabel(chart.x)
    axes.set_ylabel(chart.y)
    axes.grid(visible=True, color="#dddddd", linewidth=0.6)
    if chart.equal:
        axes.set_aspect("equal", adjustable="datalim")
    axes.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
