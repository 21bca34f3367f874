"""Where a finding's evidence lies: gain in log-likelihood per channel, stretch of time and regime."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from discrepancy.fit import Fit
from discrepancy.noise import Noise
from discrepancy.problem import Problem
from discrepancy.quantities import figures, readable
from discrepancy.recording import Array

BINS = 60  # of time, per recording
SHARE = 0.8  # of the gain, that the reported stretch holds


@dataclass(frozen=True, slots=True)
class Stretch:
    """A stretch of time in one recording [s, its own clock] and the share of all gain in it."""

    recording: str
    start_s: float
    end_s: float
    share: float


@dataclass(frozen=True, slots=True)
class Regime:
    """A third of the range of a known signal, and how much denser the gain is there than on average."""

    text: str
    share: float
    density: float


@dataclass(frozen=True, slots=True)
class Location:
    """Shares of the gain, by channel of the squared change in units of noise; `throughout` when no stretch of time stands out."""

    channels: Mapping[str, float]
    stretches: tuple[Stretch, ...]
    throughout: bool
    regimes: tuple[Regime, ...]


def locate(
    problem: Problem, noise: Noise, without: Fit, with_it: Fit, spell: range | None = None
) -> Location:
    """Compare innovations row by row, with and without the effect; spell: windows in which it acts, if not in all."""
    gain = without.residual**2 - with_it.residual**2
    total = max(float(np.sum(gain)), 1e-12)
    # gains of single channels hold noise that only cancels in their sum
    change = (without.residual - with_it.residual) ** 2
    moved = np.bincount(noise.row_channel, change, len(problem.channels)) / max(float(np.sum(change)), 1e-12)
    channels = dict(zip(problem.channels, moved.tolist(), strict=True))
    stretches = (
        _stretches(problem, noise, gain, total)
        if spell is None
        else [_spell(problem, noise, gain, total, spell)]
    )
    length = sum(w.end_s - w.start_s for w in problem.windows)
    covered = sum(s.end_s - s.start_s for s in stretches)
    return Location(
        dict(sorted(channels.items(), key=lambda item: -item[1])),
        tuple(stretches),
        spell is None and covered > 0.5 * length,
        tuple(_regimes(problem, noise, gain, total)),
    )


def _stretches(problem: Problem, noise: Noise, gain: Array, total: float) -> list[Stretch]:
    """Per recording, the stretch where the gain outruns half its own average the most (maximum subarray)."""
    owner = np.array([problem.windows[w].recording for w in noise.row_window])
    found = []
    for recording in dict.fromkeys(w.recording for w in problem.windows):
        rows = owner == recording
        time_s, share = noise.row_time[rows], gain[rows] / total
        if float(np.sum(share)) < 0.5 * rows.mean():
            continue
        edges = np.linspace(time_s.min(), time_s.max() + 1e-9, BINS + 1)
        per_bin = np.bincount(np.clip(np.digitize(time_s, edges) - 1, 0, BINS - 1), share, BINS)
        low, high = densest(per_bin - 0.5 * np.sum(per_bin) / BINS)
        found.append(
            Stretch(recording, float(edges[low]), float(edges[high]), float(np.sum(per_bin[low:high])))
        )
    return found


def _spell(problem: Problem, noise: Noise, gain: Array, total: float, spell: range) -> Stretch:
    first, last = problem.windows[spell.start], problem.windows[spell.stop - 1]
    rows = (noise.row_window >= spell.start) & (noise.row_window < spell.stop)
    return Stretch(first.recording, first.start_s, last.end_s, float(np.sum(gain[rows])) / total)


def densest(values: Array) -> tuple[int, int]:
    """Half-open range with the largest sum (Kadane)."""
    best, best_range, now, start = -np.inf, (0, len(values)), 0.0, 0
    for i, value in enumerate(values.tolist()):
        if now <= 0.0:
            now, start = 0.0, i
        now += value
        if now > best:
            best, best_range = now, (start, i + 1)
    return best_range


def _regimes(problem: Problem, noise: Noise, gain: Array, total: float) -> list[Regime]:
    found = []
    names = [n for n in (*problem.model.inputs, *problem.channels) if all(w.has(n) for w in problem.windows)]
    units = {**problem.model.inputs, **problem.model.outputs}
    for name in names:
        unit, ranges = regimes_of(problem, noise, name, units[name])
        for text, rows in ranges.items():
            share, size = float(np.sum(gain[rows])) / total, float(rows.mean())
            if size > 0.05 and share / size > 1.5:
                found.append(Regime(f"{name} {text} {unit}".rstrip(), share, share / size))
    return sorted(found, key=lambda r: -r.density)[:4]


def regimes_of(
    problem: Problem, noise: Noise, name: str, unit: str
) -> tuple[str, dict[str, NDArray[np.bool_]]]:
    """Rows in the thirds of a known signal's range, and the unit that these are told in."""
    value = at_rows(problem, noise, name)
    factor, told = readable(unit, float(np.max(np.abs(value))))
    return told, thirds(value / factor)


def thirds(value: Array) -> dict[str, NDArray[np.bool_]]:
    """Rows in the thirds of a signal's range, by what they are called; of one that mostly rests, those at rest and those beyond."""
    low, high = np.quantile(value, [1 / 3, 2 / 3])
    found = {
        f"below {figures(low)}": value < low,
        f"{figures(low)} to {figures(high)}" if low < high else f"at {figures(low)}": (value >= low)
        & (value <= high),
        f"above {figures(high)}": value > high,
    }
    return {text: rows for text, rows in found.items() if rows.any()} if np.ptp(value) > 0.0 else {}


def at_rows(problem: Problem, noise: Noise, name: str) -> Array:
    """An input or measured output at each whitened row, in its own unit."""
    value = np.empty(noise.keep.size)
    for i, window in enumerate(problem.windows):
        rows = noise.row_window == i
        value[rows] = np.interp(noise.row_time[rows], window.time_s, window[name])
    return value
