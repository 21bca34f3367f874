"""Maps, traces and spectra of a diagnosis, drawn with the parts of the bench report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from discrepancy.evidence import Evidence, MapRow, RegimeCell
from discrepancy.findings import ChannelNoise
from hil.diagnose.page import heat as heat_map
from hil.diagnose.page import spectrum
from hil.diagnose.page.heat import HeatRow
from hil.diagnose.page.tables import Cell, heat, plain, table
from hil.report import plot
from hil.report.axis import Axis
from hil.report.plot import Curve, Plot, Timeline

MOST_RECORDINGS = 8
APART = (
    2.0  # recordings whose clocks lie further apart than this many lengths are drawn from their own starts
)


@dataclass(frozen=True, slots=True)
class Clock:
    """One time axis for all recordings; origin: what is subtracted from the stamps of each."""

    axis: Axis
    origin: Mapping[str, float]
    end: Mapping[str, float]

    @classmethod
    def of(cls, shown: Evidence) -> "Clock":
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
        return Timeline(self.axis, self.end[recording])


def mismatch(shown: Evidence, clock: Clock) -> str:
    """Channel by time for each recording, and channel by regime."""
    recordings = list(dict.fromkeys(r.recording for r in shown.time_map))
    parts = [
        "<p class=soft>Root mean square of the held-out residual, in one-step errors. Noise alone leaves about 1.</p>",
        heat_map.key(),
    ]
    for name in recordings[:MOST_RECORDINGS]:
        rows = [row for r in shown.time_map if r.recording == name for row in _rows(r, clock)]
        head = f"<h3>{plain(name).markup}</h3>" if len(recordings) > 1 else ""
        parts.append(head + heat_map.markup(rows, clock.line(name)))
    if len(recordings) > MOST_RECORDINGS:
        parts.append(f"<p class=soft>and {len(recordings) - MOST_RECORDINGS} more recordings, not drawn.</p>")
    return "".join(parts) + _regimes(shown.regimes)


def _rows(row: MapRow, clock: Clock) -> list[HeatRow]:
    edges = row.edges_s - clock.origin[row.recording]
    rows = [HeatRow(f"{row.channel}, before" if row.after is not None else row.channel, edges, row.before)]
    return rows + ([HeatRow(f"{row.channel}, after", edges, row.after)] if row.after is not None else [])


def _regimes(cells: Sequence[RegimeCell]) -> str:
    if not cells:
        return ""
    channels = list(dict.fromkeys(c.channel for c in cells))
    several = cells[0].after is not None
    head = ["where", ""]
    for channel in channels:
        head += [f"{channel}, before", "after"] if several else [channel]
    by_place = {(c.signal, c.regime, c.channel): c for c in cells}
    rows: list[list[Cell]] = []
    above = ""
    for signal, regime in dict.fromkeys((c.signal, c.regime) for c in cells):
        row = [plain("" if signal == above else signal), plain(regime)]
        above = signal
        for channel in channels:
            cell = by_place.get((signal, regime, channel))
            row.append(heat(cell.before if cell else None))
            row += [heat(cell.after if cell else None)] if several else []
        rows.append(row)
    return "<h3>By regime</h3>" + table(head, rows, numbers=range(2, len(head)))


def traces(shown: Evidence, clock: Clock) -> str:
    """Recorded, and predicted before and after, on held-out stretches; a row of plots per recording."""
    recordings = list(dict.fromkeys(t.recording for t in shown.traces))[:MOST_RECORDINGS]
    parts = []
    for name in recordings:
        plots = []
        for t in [t for t in shown.traces if t.recording == name]:
            time_s = t.time_s - clock.origin[name]
            curves = [
                Curve("recorded", time_s, t.recorded, "truth"),
                Curve("before", time_s, t.before, "predicted"),
            ]
            curves += [Curve("after", time_s, t.after, "estimate")] if t.after is not None else []
            unit = "" if t.unit == "1" else t.unit
            plots.append(Plot(title=t.channel, unit=unit, curves=curves))
            errors = [Curve("before", time_s, t.recorded - t.before, "predicted")]
            errors += (
                [Curve("after", time_s, t.recorded - t.after, "estimate")] if t.after is not None else []
            )
            plots.append(
                Plot(title=f"{t.channel}, recorded minus simulated", unit=unit, curves=errors, always=(0.0,))
            )
        shown_plots = "".join(plot.markup(p, plot.common_range([p]), clock.line(name)) for p in plots)
        parts.append(
            f'<div class="rows single"><p class="run key">{plain(name).markup}</p>{shown_plots}</div>'
        )
    note = "Every stretch is predicted with parameters from the other stretches; initial states are the stretch's own."
    return f'<p class="soft">{note}</p>{"".join(parts)}'


def residuals(shown: Evidence, noise: Sequence[ChannelNoise]) -> str:
    """Spectra and autocorrelations of the whitened residuals, and the verdict on whiteness."""
    drawn = "".join(spectrum.power(s) + spectrum.correlation(s) for s in shown.spectra)
    rows = [
        [
            plain(n.channel),
            plain(f"{n.one_step_error:.3g} {'' if n.unit == '1' else n.unit}".strip(), "n"),
            plain(str(n.order), "n"),
            plain(f"{n.whiteness_p:.3f}", "n"),
            plain(
                "yes" if n.whiteness_p > 0.01 else "no: something is left, or the noise is not of this kind"
            ),
        ]
        for n in noise
    ]
    head = ("channel", "one-step error", "order of its memory", "p (Ljung-Box)", "white")
    note = "A model that leaves nothing out leaves residuals without structure: power 1 at every frequency, correlation within the band."
    return f'<p class="soft">{note}</p>{table(head, rows, numbers=(1, 2, 3))}<div class="rows single">{drawn}</div>'
