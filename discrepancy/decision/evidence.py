"""The evidence behind a verdict, for the HTML page: simulated and recorded values on held-out data, and their residuals.

Residuals are in units of the final one-step error, with and without the findings. Shared parameters are fitted to other data than those
shown; initial states are fitted to the same window.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from discrepancy.decision.judgement import Judgement
from discrepancy.decision.regimes import BINS, regimes_of, time_bins
from discrepancy.estimation.noise import Noise
from discrepancy.estimation.problem import Problem, Values
from discrepancy.selection.candidate_fits import cross_validated
from discrepancy.selection.state import Settings
from discrepancy.signals.recording import Array

LAGS = 40  # of the autocorrelation [samples]
FEWEST = 16  # samples for a spectrum


@dataclass(frozen=True, slots=True)
class Trace:
    """One channel of one recording. NaN separates windows and gaps."""

    recording: str
    channel: str
    unit: str
    time_s: Array  # (n,)
    recorded: Array
    before: Array  # predicted by the baseline
    after: Array | None  # predicted with the findings; None without any


@dataclass(frozen=True, slots=True)
class MapRow:
    """Root mean square of whitened residuals of one channel of one recording, by bins of time."""

    recording: str
    channel: str
    edges_s: Array  # (BINS + 1,)
    before: Array  # (BINS,) [one-step errors]; NaN: no rows
    after: Array | None


@dataclass(frozen=True, slots=True)
class RegimeCell:
    """Root mean square of whitened residuals of one channel in a third of the range of a known signal."""

    channel: str
    signal: str  # name and unit
    regime: str  # such as 'below -1.2'
    before: float  # [one-step errors]
    after: float | None


@dataclass(frozen=True, slots=True)
class Spectrum:
    """Spectrum and autocorrelation of the whitened residuals of one channel."""

    channel: str
    frequency_hz: Array
    before: Array  # power density over that of white noise of variance 1
    after: Array | None
    lag_s: Array
    correlation_before: Array
    correlation_after: Array | None
    band: float  # 95 % of the autocorrelations of white residuals are smaller in size


@dataclass(frozen=True, slots=True)
class Evidence:
    """Everything that the page draws."""

    traces: Sequence[Trace]
    time_map: Sequence[MapRow]
    regimes: Sequence[RegimeCell]
    spectra: Sequence[Spectrum]


def evidence(judged: Judgement, settings: Settings) -> Evidence:
    """Held-out predictions of the baseline and of the model with the findings, and their residuals."""
    problem, state = judged.problem, judged.state
    least = problem.costs.least_reduction(sum(found.sse_reduction for found in judged.findings.findings))
    baseline = judged.baseline.fit.values.warmed_up_as(state.fit.values)
    before = held_out_prediction(problem, state.noise, (), baseline, settings, least_reduction=least)
    after = (
        held_out_prediction(problem, state.noise, state.accepted, state.fit.values, settings)
        if state.accepted
        else None
    )
    white = [state.noise.whiten(problem.measured - rows) for rows in (before, after) if rows is not None]
    left, left_after = white[0], white[1] if after is not None else None
    return Evidence(
        list(_traces(problem, before, after)),
        _time_map(problem, state.noise, left, left_after),
        _regimes(problem, state.noise, left, left_after),
        _spectra(problem, state.noise, left, left_after),
    )


def held_out_prediction(
    problem: Problem,
    noise: Noise,
    effects: Sequence[str],
    start: Values,
    settings: Settings,
    *,
    least_reduction: float = 0.0,
) -> Array:
    """Predicted raw rows (N,): every row from shared parameters that were fitted without it; least_reduction: of Effort."""
    predicted = np.empty(problem.measured.size)
    following = np.clip(np.searchsorted(noise.keep, np.arange(problem.measured.size)), 0, noise.keep.size - 1)
    folds = cross_validated(problem, noise, effects, start, settings, least_reduction=least_reduction)
    for test, judged in folds:
        rows = test[following]  # a row that is set aside belongs to the fold of the row that follows it
        predicted[rows] = problem.predict(judged.values)[rows]
    return predicted


def _traces(problem: Problem, before: Array, after: Array | None) -> list[Trace]:
    parts: dict[tuple[str, str], list[list[Array]]] = {}
    for block in problem.blocks:
        recording, (_, c) = problem.windows[block.window].recording, block.shape
        for i, channel in enumerate(block.channels):
            rows = slice(block.start + i, block.stop, c)
            columns = [block.time_s, problem.measured[rows], before[rows]]
            columns += [after[rows]] if after is not None else []
            parts.setdefault((recording, channel), []).append(columns)
    traces = []
    for (recording, channel), blocks in parts.items():
        blocks.sort(key=lambda columns: columns[0][0])
        joined = [_joined([b[k] for b in blocks]) for k in range(len(blocks[0]))]
        joined[0] = np.concatenate([np.append(b[0], b[0][-1]) for b in blocks])[:-1]
        unit = problem.model.outputs[channel]
        traces.append(
            Trace(
                recording,
                channel,
                unit,
                joined[0],
                joined[1],
                joined[2],
                joined[3] if len(joined) > 3 else None,
            )
        )
    return traces


def _joined(parts: Sequence[Array]) -> Array:
    return np.concatenate([np.append(p, np.nan) for p in parts])[:-1]


def _time_map(problem: Problem, noise: Noise, before: Array, after: Array | None) -> list[MapRow]:
    found = []
    for bins in time_bins(problem, noise):
        for i, channel in enumerate(problem.channels):
            own = noise.row_channel[bins.rows] == i
            if not own.any():
                continue
            rows, at = np.flatnonzero(bins.rows)[own], bins.bin_of[own]
            found.append(
                MapRow(
                    bins.recording,
                    channel,
                    bins.edges_s,
                    _rms_in(at, before[rows]),
                    None if after is None else _rms_in(at, after[rows]),
                )
            )
    return found


def _rms_in(at: NDArray[np.intp], values: Array) -> Array:
    count = np.bincount(at, minlength=BINS).astype(float)
    total = np.bincount(at, values**2, BINS)
    mean: Array = np.divide(total, count, out=np.full(BINS, np.nan), where=count > 0)
    return np.sqrt(mean)


def _regimes(problem: Problem, noise: Noise, before: Array, after: Array | None) -> list[RegimeCell]:
    model = problem.model
    units = {**model.inputs, **model.optional, **model.outputs}
    found = []
    for name in [n for n in units if all(w.has(n) for w in problem.windows)]:
        unit, ranges = regimes_of(problem, noise, name, units[name])
        for text, rows in ranges.items():
            for i, channel in enumerate(problem.channels):
                chosen = rows & (noise.row_channel == i)
                if chosen.any():
                    found.append(
                        RegimeCell(
                            channel,
                            f"{name} [{unit}]".removesuffix(" []"),
                            text,
                            _rms(before[chosen]),
                            None if after is None else _rms(after[chosen]),
                        )
                    )
    return found


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _spectra(problem: Problem, noise: Noise, before: Array, after: Array | None) -> list[Spectrum]:
    found = []
    for i, channel in enumerate(problem.channels):
        rows = noise.row_channel == i
        steps = np.diff(noise.row_time[rows])
        step = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
        count = int(np.count_nonzero(rows))
        if count < FEWEST or step == 0.0:
            continue
        of_before = _power(before[rows], step)
        of_after = None if after is None else _power(after[rows], step)[1]
        lags = min(LAGS, count // 4)
        found.append(
            Spectrum(
                channel,
                of_before[0],
                of_before[1],
                of_after,
                np.asarray(step * np.arange(1, lags + 1), float),
                _correlation(before[rows], lags),
                None if after is None else _correlation(after[rows], lags),
                1.96 / float(np.sqrt(count)),
            )
        )
    return found


def _power(values: Array, step: float) -> tuple[Array, Array]:
    """One-sided density over that of white noise of unit variance, by averaged periodograms (Welch)."""
    f, p = welch(values, fs=1.0 / step, nperseg=min(values.size, max(FEWEST, values.size // 8)))
    return f[1:], np.asarray(p[1:] / (2.0 * step), float)


def _correlation(values: Array, lags: int) -> Array:
    e = values - np.mean(values)
    power = float(e @ e) or 1.0
    return np.array([float(e[k:] @ e[:-k]) / power for k in range(1, lags + 1)])
