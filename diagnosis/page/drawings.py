"""Chapters of the diagnosis page with drawings: maps of the mismatch, traces, spectra."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.page import heat as heat_map
from diagnosis.page import spectrum
from diagnosis.page.figure import versions
from diagnosis.page.heat import HeatRow
from diagnosis.page.tables import Cell, heat, plain, table
from discrepancy.decision.evidence import Evidence, MapRow, RegimeCell, Trace
from discrepancy.signals.findings import ChannelNoise
from discrepancy.signals.quantities import figures, readable, span
from discrepancy.signals.recording import Array
from report.kit import plot
from report.kit.axis import Axis
from report.kit.plot import Curve, Plot, Timeline

MOST_RECORDINGS = 8
MOST_CHANNELS, MOST_SIGNALS = 4, 8  # of the table by regime, which can be read
MOST_PAIRS = 8  # of plots that are open from the start
WHITE = 0.01  # p-value below which residuals are called not white
LEAST_P = 0.001  # smallest p-value that is printed as a number
# Recordings may have clocks of their own (one per logger, or per day). Where their stamps lie further apart than this many lengths
# of the longest, a common axis would be mostly empty; each is then drawn from its own start.
APART = 2.0


@dataclass(frozen=True, slots=True)
class Clock:
    """One time axis for all recordings."""

    axis: Axis
    origin: Mapping[str, float]  # by recording: the time [s] that is subtracted from its stamps
    end: Mapping[str, float]  # by recording: its end on the axis [s]

    @classmethod
    def of(cls, shown: Evidence) -> "Clock":
        """The axis that all recordings fit on."""
        spans = {t.recording: (np.inf, -np.inf) for t in shown.traces}
        for t in shown.traces:
            low, high = spans[t.recording]
            spans[t.recording] = (min(low, float(np.nanmin(t.time_s))), max(high, float(np.nanmax(t.time_s))))
        longest = max((high - low for low, high in spans.values()), default=1.0)
        first = min((low for low, _ in spans.values()), default=0.0)
        last = max((high for _, high in spans.values()), default=1.0)
        own = last - first > APART * longest
        origin = {name: low if own else 0.0 for name, (low, _) in spans.items()}
        ends = {name: high - origin[name] for name, (_, high) in spans.items()}
        start = 0.0 if own else first
        return cls(Axis(start, max([*ends.values(), start + 1e-3])), origin, ends)

    def line(self, recording: str) -> Timeline:
        """The time line of one recording."""
        return Timeline(self.axis, self.end[recording])


def mismatch(shown: Evidence, clock: Clock) -> str:
    """Channel by time for each recording, and channel by regime."""
    recordings = list(dict.fromkeys(r.recording for r in shown.time_map))
    rows = (
        " Thick row: the baseline. Thin row below: with the effects found."
        if any(r.after is not None for r in shown.time_map)
        else ""
    )
    note = (
        f"Root mean square of the residual on held-out data, in one-step errors: noise alone gives 1 or less.{rows} "
        "Channels with the largest residuals come first. Times without colour were not judged."
    )
    parts = [f"<p class=soft>{note}</p>", heat_map.key()]
    for name in recordings[:MOST_RECORDINGS]:
        of = sorted((r for r in shown.time_map if r.recording == name), key=_largest, reverse=True)
        drawn = [r for r in of if _largest(r) >= heat_map.LEVELS[0]] or of[:1]
        head = f"<h3>{plain(name).markup}</h3>" if len(recordings) > 1 else ""
        parts.append(
            head + heat_map.markup([row for r in drawn for row in _rows(r, clock)], clock.line(name))
        )
        if calm := [r.channel for r in of if r not in drawn]:
            parts.append(
                f"<p class=soft>Residuals as small as noise throughout: {plain(', '.join(calm)).markup}.</p>"
            )
    if len(recordings) > MOST_RECORDINGS:
        parts.append(f"<p class=soft>and {len(recordings) - MOST_RECORDINGS} more recordings, not drawn.</p>")
    return "".join(parts) + _regimes(shown.regimes)


def _rows(row: MapRow, clock: Clock) -> list[HeatRow]:
    edges = row.edges_s - clock.origin[row.recording]
    rows = [HeatRow(row.channel, edges, row.before)]
    return rows + ([HeatRow(row.channel, edges, row.after, after=True)] if row.after is not None else [])


def _largest(row: MapRow) -> float:
    """The largest mismatch, before or after."""
    both = [row.before] if row.after is None else [row.before, row.after]
    return max((float(np.nanmax(v)) for v in both if np.isfinite(v).any()), default=0.0)


def _regimes(cells: Sequence[RegimeCell]) -> str:
    """A table of residuals by regime: the channels with the largest, by the signals over whose range the residuals vary most."""
    if not cells:
        return ""
    channels = _ranked(cells, lambda c: c.channel, max)[:MOST_CHANNELS]
    chosen = [c for c in cells if c.channel in channels]
    signals = _ranked(chosen, lambda c: c.signal, np.ptp)[:MOST_SIGNALS]
    several = cells[0].after is not None
    head = ["where", ""]
    head += [f"{channel}, before → after" if several else channel for channel in channels]
    by_place = {(c.signal, c.regime, c.channel): c for c in chosen}
    rows: list[list[Cell]] = []
    for signal in signals:
        for i, regime in enumerate(dict.fromkeys(c.regime for c in chosen if c.signal == signal)):
            row = [plain("" if i else signal), plain(regime)]
            for channel in channels:
                cell = by_place.get((signal, regime, channel))
                row.append(heat(cell.before, cell.after) if cell else heat(None))
            rows.append(row)
    there = len({c.channel for c in cells}), len({c.signal for c in cells})
    text = f"Of {there[0]} channels and {there[1]} signals, those with the largest residuals."
    note = f"<p class=soft>{text}</p>" if there > (len(channels), len(signals)) else ""
    return f"<h3>By regime</h3>{note}" + table(head, rows, numbers=range(2, len(head)))


def traces(shown: Evidence, clock: Clock) -> str:
    """Two plots per channel, largest residuals first: recorded and predicted values on held-out segments, and their difference."""
    recordings = list(dict.fromkeys(t.recording for t in shown.traces))[:MOST_RECORDINGS]
    size = {(r.recording, r.channel): _largest(r) for r in shown.time_map}
    parts = []
    for name in recordings:
        of = [t for t in shown.traces if t.recording == name]
        of.sort(key=lambda t: -size.get((name, t.channel), 0.0))
        pairs = [_pair(t, clock) for t in of]
        parts.append(f"<h3>{plain(name).markup}</h3>{_folded(pairs, [t.channel for t in of])}")
    note = "Every segment is predicted with parameters fitted to the other segments. Only its initial state is fitted to the segment itself."
    return f'<p class="soft">{note}</p>{"".join(parts)}'


def _pair(t: Trace, clock: Clock) -> str:
    """A channel, and the difference of model and recording."""
    time_s = t.time_s - clock.origin[t.recording]
    factor, unit = readable(t.unit, float(np.nanmax(np.abs(t.recorded))))
    recorded = t.recorded / factor
    found = versions(t.before, t.after)
    curves = [Curve("recorded", time_s, recorded, "truth")]
    curves += [Curve(name, time_s, values / factor, style) for name, values, style in found]
    errors = [Curve(name, time_s, recorded - values / factor, style) for name, values, style in found]
    plots = (
        Plot(title=t.channel, unit=unit, curves=curves),
        Plot(title=f"{t.channel}, recorded minus simulated", unit=unit, curves=errors, always=(0.0,)),
    )
    return "".join(plot.markup(p, plot.common_range([p]), clock.line(t.recording)) for p in plots)


def _folded(pairs: Sequence[str], names: Sequence[str]) -> str:
    """Pairs of plots; those of many channels can be opened."""
    shown, more = pairs[:MOST_PAIRS], pairs[MOST_PAIRS:]
    drawn = f'<div class="rows single pairs">{"".join(shown)}</div>'
    if not more:
        return drawn
    rest = plain(f"{len(more)} more channels: {', '.join(names[MOST_PAIRS:])}").markup
    return f'{drawn}<details><summary>{rest}</summary><div class="rows single pairs">{"".join(more)}</div></details>'


def _ranked(
    cells: Sequence[RegimeCell],
    of: Callable[[RegimeCell], str],
    size: Callable[[Sequence[float]], float],
) -> list[str]:
    """Channels or signals by the size of the mismatch in their cells, largest first."""
    cells_of: dict[str, list[float]] = {}
    for cell in cells:
        cells_of.setdefault(of(cell), []).append(cell.before)
    return sorted(cells_of, key=lambda name: -float(size(cells_of[name])))


def recordings(shown: Evidence) -> str:
    """A table of the data that were judged: time, number of samples, step and range of each channel."""
    rows: list[list[Cell]] = []
    above = ""
    for t in shown.traces:
        stamps = t.time_s[np.isfinite(t.recorded)]
        covered = span(float(stamps[0]), float(stamps[-1]))
        values = t.recorded[np.isfinite(t.recorded)]
        factor, unit = readable(t.unit, float(np.max(np.abs(values))))
        low, high = (figures(float(end) / factor) for end in (values.min(), values.max()))
        rows.append(
            [
                plain("" if t.recording == above else t.recording),
                plain(t.channel),
                plain(covered, "n"),
                plain(f"{stamps.size}", "n"),
                plain(f"{1e3 * float(np.median(np.diff(stamps))):.3g} ms", "n"),
                plain(f"{low} to {high} {unit}".strip(), "n"),
            ]
        )
        above = t.recording
    head = ("recording", "channel", "judged", "samples", "step", "range")
    return table(head, rows, numbers=(2, 3, 4, 5))


def residuals(shown: Evidence, noise: Sequence[ChannelNoise]) -> str:
    """Spectra and autocorrelations of the whitened residuals, and the verdict on whiteness."""
    worst = {s.channel: float(np.mean(s.before)) for s in shown.spectra}
    left = remaining(shown.time_map)
    spectra = sorted(shown.spectra, key=lambda s: -worst[s.channel])
    drawn = _folded(
        [spectrum.power(s) + spectrum.correlation(s) for s in spectra], [s.channel for s in spectra]
    )
    rows = [
        [
            plain(n.channel),
            plain(_one_step_error(n), "n"),
            plain(str(n.order), "n"),
            heat(left.get(n.channel)),
            plain(f"{n.whiteness_p:.3f}" if n.whiteness_p >= LEAST_P else f"< {LEAST_P}", "n"),
            plain(_whiteness(n, left.get(n.channel, np.inf))),
        ]
        for n in noise
    ]
    head = (
        "channel",
        "one-step error",
        "order of autoregression",
        "residual / one-step error",
        "p (Ljung-Box)",
        "white noise",
    )
    note = (
        "Residuals of a complete model are white noise: power 1 or less at every frequency, autocorrelation within the band. "
        "Residuals with structure that are no larger than the assumed noise have little weight in the verdict."
    )
    return f'<p class="soft">{note}</p>{table(head, rows, numbers=(1, 2, 3, 4))}{drawn}'


def _whiteness(n: ChannelNoise, left: float) -> str:
    """Whether residuals are white; left: their root mean square [one-step errors]."""
    # Long recordings reject whiteness for structure far below the noise, which has no weight in the verdict: say so.
    if n.whiteness_p > WHITE:
        return "yes"
    return "no, but no larger than noise" if left < heat_map.LEVELS[0] else "no: the model misses something"


def remaining(rows: Sequence[MapRow]) -> dict[str, float]:
    """Root mean square residual of each channel with the effects found [one-step errors], over all recordings."""
    squares: dict[str, list[Array]] = {}
    for row in rows:
        values = row.before if row.after is None else row.after
        squares.setdefault(row.channel, []).append(values[np.isfinite(values)] ** 2)
    return {channel: float(np.sqrt(np.mean(np.concatenate(parts)))) for channel, parts in squares.items()}


def _one_step_error(n: ChannelNoise) -> str:
    factor, unit = readable(n.unit, n.one_step_error)
    return f"{figures(n.one_step_error / factor)} {unit}".rstrip()
