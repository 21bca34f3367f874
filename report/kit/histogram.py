"""Draws histograms of times, for the report: counts on a logarithmic scale, so that single outliers are visible."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import ArrayLike, NDArray

from report.kit.axis import Axis, number
from report.kit.plot import UNITS

BARS = 48


@dataclass(frozen=True, slots=True)
class Histogram:
    """A sample of times with its limit."""

    title: str
    values_ms: NDArray[np.float64]
    permitted_ms: float  # NaN: no limit


def common_end(histograms: Sequence[Histogram]) -> float:
    """Right end of the axis [ms] that shows all samples and limits."""
    ends = [float(h.values_ms.max()) for h in histograms if h.values_ms.size]
    ends += [h.permitted_ms for h in histograms if math.isfinite(h.permitted_ms)]
    return 1.04 * max(ends, default=1.0)


def milliseconds(values_ns: ArrayLike) -> NDArray[np.float64]:
    """Finite values [ns] in ms."""
    values = np.asarray(values_ns, float) * 1e-6
    return values[np.isfinite(values)]


def markup(histogram: Histogram, end_ms: float) -> str:
    """The histogram as a <figure>; end_ms: end of its axis."""
    heading = f'<figcaption>{escape(histogram.title)} <span class="unit">[ms]</span></figcaption>'
    values = histogram.values_ms
    if values.size == 0:
        return f'<figure class="plot histogram empty">{heading}<p>not measured</p></figure>'
    # from zero, so that the share of the permitted time can be seen; below it only if a tick started early
    across = Axis(min(0.0, float(values.min())), end_ms)
    counts, edges = np.histogram(values, BARS, (across.start, across.end))
    # from 0.7, so that a bar of one value has a visible height
    upward = Axis(math.log10(0.7), math.log10(max(counts.max(), 10) * 1.4))
    lines = _lines(histogram)
    bars = "".join(_bar(int(n), edges[i], edges[i + 1], across, upward) for i, n in enumerate(counts) if n)
    ticks = "".join(f'<span style="left:{across.percent(t)}">{number(t)}</span>' for t in across.ticks(6))
    # powers of ten only: other ticks of a logarithmic axis would be too dense for a plot of this height
    levels = [10**n for n in range(math.floor(upward.end) + 1)]
    labels = "".join(f'<span style="bottom:{upward.percent(math.log10(n))}">{n}</span>' for n in levels)
    drawn = "".join(
        f'<path class="{style}" d="M{round(UNITS * float(across.share(at)))} 0v{UNITS}"/>'
        for _, at, style in lines
        if at <= across.end
    )
    legend = "".join(f'<li class="{style}"><i></i>{text}</li>' for text, _, style in lines)
    described = f"{histogram.title}: {values.size} values, " + ", ".join(text for text, _, _ in lines)
    return (
        f'<figure class="plot histogram">{heading}<div class="chart"><div class="y" aria-hidden="true">{labels}</div>'
        f'<div class="area" role="img" aria-label="{escape(described)}">'
        f'<svg viewBox="0 0 {UNITS} {UNITS}" preserveAspectRatio="none" aria-hidden="true">{bars}{drawn}</svg></div>'
        f'<div class="x" aria-hidden="true"><div>{ticks}</div><em>ms; counts of {values.size}, logarithmic</em></div></div>'
        f'<ul class="legend">{legend}</ul></figure>'
    )


def _lines(histogram: Histogram) -> list[tuple[str, float, str]]:
    median, p99 = np.percentile(histogram.values_ms, (50, 99))
    lines = [
        (f"median {median:.2f}", float(median), "median"),
        (f"99 % within {p99:.2f}", float(p99), "p99"),
    ]
    if math.isfinite(histogram.permitted_ms):
        lines.append(
            (f"permitted for 99 %: {histogram.permitted_ms:.1f}", histogram.permitted_ms, "permitted")
        )
    return lines


def _bar(count: int, left: float, right: float, across: Axis, upward: Axis) -> str:
    x0, x1 = (UNITS * float(across.share(edge)) for edge in (left, right))
    height = UNITS * float(upward.share(math.log10(count)))
    gap = 0.08 * (x1 - x0)
    return f'<rect x="{x0 + gap:.0f}" y="{UNITS - height:.0f}" width="{x1 - x0 - 2 * gap:.0f}" height="{height:.0f}"/>'
