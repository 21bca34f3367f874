"""Where the evidence of a finding lies: reduction in SSE per channel, interval of time and regime."""

import numpy as np

from discrepancy.decision.regimes import BINS, regimes_of, time_bins
from discrepancy.estimation.fit import Fit
from discrepancy.estimation.noise import Noise
from discrepancy.estimation.problem import Problem, Windows
from discrepancy.selection.active_intervals import runs
from discrepancy.signals import findings as f
from discrepancy.signals.recording import Array

# Density, as a share of the average, that is subtracted before the densest interval is found. With the full average an interval would
# end at every gap by chance; with nothing subtracted it would be the whole recording.
BACKGROUND = 0.5
SMALLEST_REGIME = 0.05  # of all rows; the evidence in fewer rows is too uncertain
DENSER = 1.5  # times the average density, from which a regime is reported
MOST_REGIMES = 4
MOSTLY = 0.5  # share of the recorded time; longer intervals are reported as "throughout"


def locate(
    problem: Problem, noise: Noise, without: Fit, with_it: Fit, active: Windows | None = None
) -> f.Where:
    """Channels, intervals and regimes of the evidence; active: windows in which the effect acts, None for all."""
    reduction = without.residual**2 - with_it.residual**2
    total = max(float(np.sum(reduction)), 1e-12)
    # The share of a channel is that of the squared change. The reduction of a single channel contains a product with noise, may even
    # be negative, and is meaningful only in the sum over channels.
    change = (without.residual - with_it.residual) ** 2
    moved = np.bincount(noise.row_channel, change, len(problem.channels)) / max(float(np.sum(change)), 1e-12)
    channels = dict(zip(problem.channels, moved.tolist(), strict=True))
    share = reduction / total
    intervals = (
        _densest_intervals(problem, noise, share)
        if active is None
        else [_active_interval(problem, noise, share, run) for run in runs(problem, active)]
    )
    length = sum(w.end_s - w.start_s for w in problem.windows)
    covered = sum(s.end_s - s.start_s for s in intervals)
    return f.Where(
        channels=dict(sorted(channels.items(), key=lambda item: -item[1])),
        throughout=active is None and covered > MOSTLY * length,
        intervals=intervals,
        regimes=_regimes(problem, noise, share),
        temporary=active is not None,
    )


def _densest_intervals(problem: Problem, noise: Noise, share: Array) -> list[f.Interval]:
    """For each recording, the interval whose evidence exceeds half the average density most (maximum subarray)."""
    found, each = [], [*time_bins(problem, noise)]
    everywhere = np.concatenate([bins.summed(share) for bins in each])
    for bins in each:
        own = share[bins.rows]
        if float(np.sum(own)) < BACKGROUND * bins.rows.mean():
            continue
        per_bin = bins.summed(share)
        low, high = densest(per_bin - BACKGROUND * np.sum(per_bin) / BINS)
        found.append(
            f.Interval(
                recording=bins.recording,
                start_s=float(bins.edges_s[low]),
                end_s=float(bins.edges_s[high]),
                share=fraction(per_bin[low:high], everywhere),
            )
        )
    return found


def _active_interval(problem: Problem, noise: Noise, share: Array, active: range) -> f.Interval:
    first, last = problem.windows[active.start], problem.windows[active.stop - 1]
    per_window: Array = np.bincount(noise.row_window, share, len(problem.windows)).astype(float)
    return f.Interval(
        recording=first.recording,
        start_s=first.start_s,
        end_s=last.end_s,
        share=fraction(per_window[active.start : active.stop], per_window),
    )


def fraction(part: Array, whole: Array) -> float:
    """Share of the gains of the whole that is in a part of it, from 0 to 1; losses by noise elsewhere would make it more than all."""
    total = float(np.sum(np.maximum(whole, 0.0)))
    return min(float(np.sum(np.maximum(part, 0.0))) / total, 1.0) if total > 0.0 else 0.0


def densest(values: Array) -> tuple[int, int]:
    """The half-open range with the largest sum (Kadane's algorithm)."""
    best, best_range, now, start = -np.inf, (0, len(values)), 0.0, 0
    for i, value in enumerate(values.tolist()):
        if now <= 0.0:
            now, start = 0.0, i
        now += value
        if now > best:
            best, best_range = now, (start, i + 1)
    return best_range


def _regimes(problem: Problem, noise: Noise, share: Array) -> list[f.Regime]:
    found = []
    names = [n for n in (*problem.model.inputs, *problem.channels) if all(w.has(n) for w in problem.windows)]
    units = {**problem.model.inputs, **problem.model.outputs}
    for name in names:
        unit, ranges = regimes_of(problem, noise, name, units[name])
        sums = {text: float(np.sum(share[rows])) for text, rows in ranges.items()}
        for text, rows in ranges.items():
            size = float(rows.mean())
            own = fraction(np.array([sums[text]]), np.array([*sums.values()]))
            if size > SMALLEST_REGIME and own / size > DENSER:
                found.append(f.Regime(text=f"{name} {text} {unit}".rstrip(), share=own, density=own / size))
    return sorted(found, key=lambda r: -r.density)[:MOST_REGIMES]
