"""Time plots as inline SVG: pure functions from arrays to markup.

A plot is drawn in units of its own viewBox and scales with the page. Long signals are reduced to the
smallest and largest sample of each horizontal pixel, so that no spike is lost. Every curve carries its
samples for the cursor readout in a `data-` attribute, reduced to the same grid.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

WIDTH, HEIGHT = 640, 220
LEFT, RIGHT, TOP, BOTTOM = 62, 12, 12, 34
PIXELS = 560
READOUT_POINTS = 300


@dataclass(frozen=True, slots=True)
class Curve:
    """One line of a plot. style: a class name of the style sheet, which gives colour and dash."""

    name: str
    time_s: NDArray[np.float64]
    value: NDArray[np.float64]
    style: str
    steps: bool = False  # hold the value until the next sample


@dataclass(frozen=True, slots=True)
class Mark:
    """A moment drawn as a vertical line with a label."""

    time_s: float
    label: str
    style: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Plot:
    """What one plot shows. low, high: range that has to be visible even if no sample reaches it."""

    title: str
    unit: str
    curves: Sequence[Curve]
    marks: Sequence[Mark] = field(default=())
    low: float | None = None
    high: float | None = None
    until_s: float | None = None
    from_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Axis:
    """A linear axis from data to pixels."""

    start: float
    end: float
    first: float
    last: float

    def at(self, value: ArrayLike) -> NDArray[np.float64]:
        """Pixel of `value`."""
        share = (np.asarray(value, float) - self.start) / (self.end - self.start)
        return self.first + share * (self.last - self.first)


def nice_ticks(low: float, high: float, count: int = 5) -> list[float]:
    """About `count` round numbers from `low` to `high`, in steps of 1, 2 or 5 times a power of ten."""
    if not (math.isfinite(low) and math.isfinite(high)) or high <= low:
        raise ValueError(f"ticks need low < high, both finite; got {low} and {high}")
    rough = (high - low) / count
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= rough * (1 - 1e-9))
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [n * step for n in range(first, last + 1)]


def number(value: float) -> str:
    """A tick label: no trailing zeros, a real minus sign."""
    text = f"{value:.6g}"
    return (text if text != "-0" else "0").replace("-", "−")


def reduce(
    time_s: ArrayLike, value: ArrayLike, pixels: int = PIXELS
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """At most 2 samples per pixel, the extremes of each, in time order. NaN samples stay and break the line."""
    time, values = np.asarray(time_s, float), np.asarray(value, float)
    if time.size <= 2 * pixels:
        return time, values
    edges = np.linspace(0, time.size, pixels + 1).astype(int)
    kept: list[int] = []
    for start, stop in pairwise(edges.tolist()):
        part = values[start:stop]
        if np.isnan(part).all():
            kept.append(start)
            continue
        kept.extend(sorted({start + int(np.nanargmin(part)), start + int(np.nanargmax(part))}))
    index = np.array(kept)
    return time[index], values[index]


def svg(plot: Plot, name: str) -> str:
    """The plot as a <figure> with an SVG, a legend and a text alternative; `name` is unique on the page."""
    drawn = [curve for curve in plot.curves if np.isfinite(curve.value).any()]
    if not drawn:
        return f'<figure class="plot empty"><figcaption>{escape(plot.title)}</figcaption><p>not recorded</p></figure>'
    end = plot.until_s if plot.until_s is not None else max(float(c.time_s[-1]) for c in drawn)
    across = Axis(plot.from_s, max(end, plot.from_s + 1e-3), LEFT, WIDTH - RIGHT)
    low, high = _range(plot, drawn, across)
    upward = Axis(low, high, HEIGHT - BOTTOM, TOP)
    parts = [
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(_described(plot, drawn))}" '
        f'data-x="{across.start:.6g} {across.end:.6g} {LEFT} {WIDTH - RIGHT}" tabindex="0">',
        *_grid(across, upward, plot.unit),
        f'<clipPath id="{name}-clip"><rect x="{LEFT}" y="{TOP}" width="{WIDTH - LEFT - RIGHT}" '
        f'height="{HEIGHT - TOP - BOTTOM}"/></clipPath><g clip-path="url(#{name}-clip)">',
        *(_mark_line(mark, across) for mark in plot.marks),
        *(_path(curve, across, upward) for curve in drawn),
        "</g>",
        *_mark_labels(plot.marks, across),
        f'<line class="cursor" y1="{TOP}" y2="{HEIGHT - BOTTOM}" x1="-9" x2="-9"/></svg>',
    ]
    legend = "".join(
        f'<li class="{curve.style}" data-curve="{escape(_samples(curve, across))}"><i></i>{escape(curve.name)} '
        "<output></output></li>"
        for curve in drawn
    )
    unit = f" <small>{escape(plot.unit)}</small>" if plot.unit else ""
    return (
        f'<figure class="plot"><figcaption>{escape(plot.title)}{unit}</figcaption>'
        f'{"".join(parts)}<ul class="legend">{legend}</ul></figure>'
    )


def _range(plot: Plot, curves: Sequence[Curve], across: Axis) -> tuple[float, float]:
    values = [c.value[(c.time_s >= across.start) & (c.time_s <= across.end)] for c in curves]
    every = np.concatenate([v[np.isfinite(v)] for v in values])
    if every.size == 0:
        every = np.zeros(1)
    low, high = float(every.min()), float(every.max())
    low = min(low, plot.low) if plot.low is not None else low
    high = max(high, plot.high) if plot.high is not None else high
    room = 0.06 * (high - low) if high > low else max(abs(high), 1.0) * 0.1
    return low - room, high + room


def _described(plot: Plot, curves: Sequence[Curve]) -> str:
    spans = ", ".join(
        f"{c.name} from {np.nanmin(c.value):.3g} to {np.nanmax(c.value):.3g} {plot.unit}".rstrip()
        for c in curves
    )
    marks = "".join(f"; {mark.label} at {mark.time_s:.2f} s" for mark in plot.marks)
    return f"{plot.title} over time: {spans}{marks}"


def _grid(across: Axis, upward: Axis, unit: str) -> list[str]:
    parts = []
    for tick in nice_ticks(upward.start, upward.end, 5):
        y = float(upward.at(tick))
        parts.append(f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>')
        parts.append(f'<text class="y" x="{LEFT - 6}" y="{y + 3.5:.1f}">{number(tick)}</text>')
    for tick in nice_ticks(across.start, across.end, 8):
        x = float(across.at(tick))
        parts.append(f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}"/>')
        parts.append(f'<text class="x" x="{x:.1f}" y="{HEIGHT - BOTTOM + 15}">{number(tick)}</text>')
    parts.append(
        f'<text class="x" x="{WIDTH - RIGHT}" y="{HEIGHT - 3}" style="text-anchor:end">time [s]</text>'
    )
    if unit:
        parts.append(
            f'<text class="x" x="4" y="{HEIGHT - 3}" style="text-anchor:start">[{escape(unit)}]</text>'
        )
    return parts


def _path(curve: Curve, across: Axis, upward: Axis) -> str:
    time, value = reduce(curve.time_s, curve.value)
    x, y = across.at(time), upward.at(value)
    words: list[str] = []
    pen_down = False
    for i in range(x.size):
        if not math.isfinite(y[i]):
            pen_down = False
        elif not pen_down:
            words.append(f"M{x[i]:.1f} {y[i]:.1f}")
            pen_down = True
        else:
            words.append(f"H{x[i]:.1f}V{y[i]:.1f}" if curve.steps else f"L{x[i]:.1f} {y[i]:.1f}")
    return f'<path class="{curve.style}" d="{"".join(words)}"/>'


def _mark_line(mark: Mark, across: Axis) -> str:
    x = float(across.at(mark.time_s))
    return f'<line class="mark {mark.style}" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}"/>'


def _mark_labels(marks: Sequence[Mark], across: Axis) -> list[str]:
    """Labels beside their lines, on the side that has room, one row each."""
    parts = []
    for row, mark in enumerate(marks):
        if not across.start <= mark.time_s <= across.end:
            continue
        x = float(across.at(mark.time_s))
        left = x > (LEFT + WIDTH) / 2
        anchor, shift = ("end", -4) if left else ("start", 4)
        parts.append(
            f'<text class="mark {mark.style}" x="{x + shift:.1f}" y="{TOP + 11 + 12 * row}" '
            f'style="text-anchor:{anchor}">{escape(mark.label)}</text>'
        )
    return parts


def _samples(curve: Curve, across: Axis) -> str:
    """Values on an even grid over the axis, for the cursor; an empty word where there is none."""
    known = np.isfinite(curve.value)
    grid = np.linspace(across.start, across.end, READOUT_POINTS)
    time, value = curve.time_s[known], curve.value[known]
    index = np.clip(np.searchsorted(time, grid, side="right") - 1, 0, time.size - 1)
    picked = value[index] if curve.steps else np.interp(grid, time, value)
    inside = (grid >= time[0]) & (grid <= time[-1] + (grid[1] - grid[0]))
    return ",".join(f"{v:.4g}" if ok else "" for v, ok in zip(picked, inside, strict=True))
