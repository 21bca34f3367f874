"""Time plots as HTML and SVG: pure functions from arrays to markup.

The drawing is stretched to its box while lines and letters keep their size, so one markup serves a
wide screen, a telephone and paper. The script reads values back from the drawn paths,
which resolve a ten-thousandth of either axis.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from report.kit.axis import Axis, around, number

UNITS = 10_000  # width and height of a drawing
BINS = 2_000
TIGHT = 0.18  # marks nearer than this share of the axis show their number only: a word takes 65 of some 375 pixels
TOUCHING = 0.035  # and nearer than this would cover one another


@dataclass(frozen=True, slots=True)
class Curve:
    """One line of a plot."""

    name: str
    time_s: NDArray[np.float64]
    value: NDArray[np.float64]  # in the plot's unit; NaN breaks the line
    style: str  # class name of the style sheet, for colour and dash
    steps: bool = False  # hold the value until the next sample
    silent: bool = False  # drawn, but in neither legend nor readout: the lower of a pair of limits


@dataclass(frozen=True, slots=True)
class Mark:
    """A moment drawn as a vertical line."""

    time_s: float
    word: str  # label in the plot: one or two words
    sentence: str  # for the tooltip and the list of moments
    style: str  # class name of the style sheet


@dataclass(frozen=True, slots=True)
class Timeline:
    """The time axis that all plots of one run share."""

    axis: Axis
    end_s: float  # end of the run's recording, which may be before the end of the axis
    marks: Sequence[Mark] = field(default=())


@dataclass(frozen=True, slots=True, kw_only=True)
class Plot:
    """The content of one plot."""

    title: str
    unit: str
    curves: Sequence[Curve]
    always: Sequence[float] = ()  # values that are visible even if no sample reaches them

    @property
    def drawn(self) -> list[Curve]:
        """The curves that have a value to draw."""
        return [curve for curve in self.curves if np.isfinite(curve.value).any()]


def common_range(plots: Sequence[Plot]) -> Axis:
    """One value axis for the same plot of several runs, so that they can be compared by eye."""
    return around((c.value for p in plots for c in p.drawn), [a for p in plots for a in p.always])


def reduce(
    time_s: ArrayLike, value: ArrayLike, bins: int = BINS
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """At most 2 samples per bin, the extremes of each, in time order. NaN samples stay and break the line."""
    time, values = np.asarray(time_s, float), np.asarray(value, float)
    if time.size <= 2 * bins:
        return time, values
    kept: list[int] = []
    for start, stop in pairwise(np.linspace(0, time.size, bins + 1).astype(int).tolist()):
        part = values[start:stop]
        # one sample stays, so that the gap is visible in the line
        if np.isnan(part).all():
            kept.append(start)
            continue
        # both extremes of each bin, so that no spike is lost; thinning by every n-th sample would lose it
        kept.extend(sorted({start + int(np.nanargmin(part)), start + int(np.nanargmax(part))}))
    index = np.array(kept)
    return time[index], values[index]


def markup(plot: Plot, upward: Axis, timeline: Timeline) -> str:
    """The plot as a <figure> with axes, legend and a text alternative."""
    unit = f' <span class="unit">[{escape(plot.unit)}]</span>' if plot.unit else ""
    heading = f"<figcaption>{escape(plot.title)}{unit}</figcaption>"
    if not plot.drawn:
        return f'<figure class="plot empty">{heading}<p>not recorded</p></figure>'
    across = timeline.axis
    lines = "".join(path(curve, across, upward) for curve in plot.drawn)
    area = (
        f'<div class="area" role="img" aria-label="{escape(_described(plot, timeline))}" '
        f'data-t="{across.start:.6g} {across.end:.6g}" data-y="{upward.start:.6g} {upward.end:.6g}">'
        f"{canvas(_level_lines(upward), marked(timeline) + lines, across)}{events(timeline)}</div>"
    )
    return (
        f'<figure class="plot">{heading}<div class="chart">{_value_labels(upward)}{area}{time_labels(across)}</div>'
        f"{_legend(plot.drawn)}</figure>"
    )


def canvas(behind: str, moving: str, across: Axis) -> str:
    """The stretched drawing. behind: stays in place; moving: follows a zoom of the time axis."""
    upright = "".join(f"M{x(across, tick)} 0v{UNITS}" for tick in across.ticks(8))
    return (
        f'<svg viewBox="0 0 {UNITS} {UNITS}" preserveAspectRatio="none" aria-hidden="true">'
        f'{behind}<path class="grid upright" d="{upright}"/><g class="moving">{moving}</g></svg>'
    )


def time_labels(across: Axis) -> str:
    """Ticks of the time axis and its name."""
    ticks = "".join(
        f'<span style="left:{across.percent(tick)}">{number(tick)}</span>' for tick in across.ticks(8)
    )
    return f'<div class="x" aria-hidden="true"><div>{ticks}</div><em>time [s]</em></div>'


def marked(timeline: Timeline) -> str:
    """Lines at the marks, and a grey area after the end of the run."""
    lines = "".join(
        f'<path class="mark {mark.style}" d="M{x(timeline.axis, mark.time_s)} 0v{UNITS}"/>'
        for mark in timeline.marks
    )
    end = x(timeline.axis, timeline.end_s)
    ended = f'<rect class="over" x="{end}" width="{UNITS - end}" height="{UNITS}"/>' if end < UNITS else ""
    return ended + lines


def events(timeline: Timeline) -> str:
    """Numbered flags above the marks; those with enough room also show their word."""
    parts = []
    places = [float(timeline.axis.share(mark.time_s)) for mark in timeline.marks]
    free = -1.0
    for i, (mark, place) in enumerate(zip(timeline.marks, places, strict=True)):
        # the last mark has the end of the axis as its neighbour
        following = places[i + 1] if i + 1 < len(places) else 1.0 + TIGHT / 2
        word = f"<em>{escape(mark.word)}</em>" if following - place > TIGHT else ""
        place = max(place, free)
        free = place + TOUCHING
        parts.append(
            f'<span class="event {mark.style}" style="left:{100 * place:.3f}%" data-at="{mark.time_s:.6g}" '
            f'title="{escape(mark.sentence)}"><b>{i + 1}</b>{word}</span>'
        )
    return "".join(parts)


def x(across: Axis, time_s: float) -> int:
    """Time in units of the drawing."""
    return round(UNITS * float(across.share(time_s)))


def path(curve: Curve, across: Axis, upward: Axis) -> str:
    """A curve as an SVG path in whole units: M after each gap, then relative steps, which are shorter."""
    time, value = reduce(curve.time_s, curve.value)
    column = np.rint(UNITS * across.share(time))
    row = np.rint(UNITS * (1 - upward.share(value)))
    known = np.isfinite(column) & np.isfinite(row)
    words = []
    for start, stop in _unbroken(known):
        # whole units keep the page small
        xs, ys = column[start:stop].astype(int), row[start:stop].astype(int)
        words.append(f"M{xs[0]} {ys[0]}" + (_stairs(xs, ys) if curve.steps else _line(xs, ys)))
    kind = f"{curve.style}{' silent' if curve.silent else ''}"
    return f'<path class="{kind}" d="{"".join(words)}"/>'


def _unbroken(known: NDArray[np.bool_]) -> list[tuple[int, int]]:
    edges = np.diff(np.concatenate(([False], known, [False])).astype(np.int8))
    return list(zip(np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist(), strict=True))


def _line(xs: NDArray[np.int64], ys: NDArray[np.int64]) -> str:
    steps = " ".join(f"{dx} {dy}" for dx, dy in zip(np.diff(xs).tolist(), np.diff(ys).tolist(), strict=True))
    return f"l{steps}" if steps else "h0"


def _stairs(xs: NDArray[np.int64], ys: NDArray[np.int64]) -> str:
    """Steps only where the value changes, and at the end."""
    turns = np.concatenate((np.flatnonzero(np.diff(ys)) + 1, [xs.size - 1]))
    words, at, level = [], int(xs[0]), int(ys[0])
    for i in turns.tolist():
        words.append(f"h{int(xs[i]) - at}v{int(ys[i]) - level}")
        at, level = int(xs[i]), int(ys[i])
    return "".join(words)


def _level_lines(upward: Axis) -> str:
    level = "".join(
        f"M0 {UNITS - round(UNITS * float(upward.share(tick)))}h{UNITS}" for tick in upward.ticks(5)
    )
    zero = ""
    if upward.start < 0 < upward.end:
        zero = f'<path class="zero" d="M0 {UNITS - round(UNITS * float(upward.share(0)))}h{UNITS}"/>'
    return f'<path class="grid" d="{level}"/>{zero}'


def _value_labels(upward: Axis) -> str:
    ticks = "".join(
        f'<span style="bottom:{upward.percent(tick)}">{number(tick)}</span>' for tick in upward.ticks(5)
    )
    return f'<div class="y" aria-hidden="true">{ticks}</div>'


def _legend(curves: Sequence[Curve]) -> str:
    """One entry per path, in their order; the script fills the outputs."""
    entries = "".join(
        f'<li class="{c.style}"{" hidden" if c.silent else ""}{" data-steps" if c.steps else ""}><i></i>'
        f"{escape(c.name)} <output></output></li>"
        for c in curves
    )
    return f'<ul class="legend">{entries}</ul>'


def _described(plot: Plot, timeline: Timeline) -> str:
    # for screen readers, which cannot see the drawing
    spans = ", ".join(
        f"{c.name} from {np.nanmin(c.value):.3g} to {np.nanmax(c.value):.3g} {plot.unit}".rstrip()
        for c in plot.drawn
        if not c.silent
    )
    marks = "".join(f"; {mark.sentence}" for mark in timeline.marks)
    return f"{plot.title} over time: {spans}{marks}"
