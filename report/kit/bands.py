"""Draws states over time as coloured bars with their names, for the report."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import ArrayLike

from report.kit.axis import Axis
from report.kit.plot import Timeline, canvas, events, marked, time_labels


@dataclass(frozen=True, slots=True)
class Interval:
    """Unbroken time of one state."""

    start_s: float
    end_s: float
    word: str  # name of the state
    severity: int  # 0 (normal) to 3; chooses the colour


@dataclass(frozen=True, slots=True)
class Band:
    """A state over time."""

    name: str
    intervals: tuple[Interval, ...]
    meaning: str = ""  # a sentence for the tooltip, where the name is not enough


def intervals(
    time_s: ArrayLike,
    value: ArrayLike,
    words: Mapping[int, tuple[str, int]],
    window: tuple[float, float] = (-math.inf, math.inf),
) -> tuple[Interval, ...]:
    """Unbroken intervals of one value. words: value -> name and severity; other values count as not available.

    window: samples outside of it [s] do not count. The last sample ends the last interval.
    """
    time, values = np.asarray(time_s, float), np.asarray(value, float)
    within = (time >= window[0]) & (time <= window[1])
    time, values = time[within], values[within]
    if time.size == 0:
        return ()
    # a state is a step: it lasts until the next sample with another value
    starts = np.concatenate(([0], np.flatnonzero(np.diff(values)) + 1))
    ends = np.concatenate((time[starts[1:]], time[-1:]))
    return tuple(
        Interval(float(time[i]), float(end), *words.get(int(values[i]), ("not available", 0)))
        for i, end in zip(starts, ends, strict=True)
    )


def markup(bands: Sequence[Band], timeline: Timeline) -> str:
    """All bands of a run over one time axis."""
    across = timeline.axis
    rows = "".join(_row(band, across) for band in bands)
    return (
        f'<div class="bands" data-t="{across.start:.6g} {across.end:.6g}">'
        f'<div class="overlay">{canvas("", marked(timeline), across)}{events(timeline)}</div>'
        f'{rows}<div class="band ends"><span></span>{time_labels(across)}</div></div>'
    )


def _row(band: Band, across: Axis) -> str:
    title = f' title="{escape(band.meaning)}"' if band.meaning else ""
    bars = "".join(_bar(interval, across) for interval in band.intervals)
    return (
        f'<div class="band"><span class="name"{title}>{escape(band.name)}<output></output></span>'
        f'<div class="track" role="img" aria-label="{escape(described(band))}"><div class="moving">{bars}</div></div></div>'
    )


def _bar(interval: Interval, across: Axis) -> str:
    # cut at the ends of the axis: an ECU runs before and after its machine
    start, end = (min(max(t, across.start), across.end) for t in (interval.start_s, interval.end_s))
    left, width = 100 * float(across.share(start)), 100 * (end - start) / (across.end - across.start)
    return (
        f'<i class="s{interval.severity}" style="left:{left:.3f}%;width:{width:.3f}%" '
        f'title="{escape(interval.word)}: {interval.start_s:.2f} to {interval.end_s:.2f} s"><b>{escape(interval.word)}</b></i>'
    )


def described(band: Band, most: int = 6) -> str:
    """The band as text, for screen readers; at most `most` intervals."""
    shown = [f"{s.word} {s.start_s:.2f} to {s.end_s:.2f} s" for s in band.intervals if s.severity]
    more = f" and {len(shown) - most} more" if len(shown) > most else ""
    return f"{band.name}: {', '.join(shown[:most]) or 'quiet throughout'}{more}"
