"""Filters of sampled signals. Offline filters have no delay; the causal one returns its delay.

Sources: thesis, appendix A and section 3.6; Oppenheim and Schafer for group delay. All filters are second-order sections, because the
polynomial form of a 9th-order filter at 5 Hz of 500 Hz is ill-conditioned.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import signal
from scipy.ndimage import median_filter, uniform_filter1d

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ORDER, CUTOFF_HZ = 9, 5.0
SPIKE = 8.0  # standard deviations from a median of neighbours
NEIGHBOURS = 5  # on either side of a gap
NORMAL = 1.4826  # standard deviations of a normal variable in one median absolute deviation


def spikes(value: Array, window: int = 9, beyond: float = SPIKE) -> Mask:
    """Samples (n,) far from the median of their neighbours: single damaged readings. NaN is none."""
    known = np.isfinite(value)
    if np.count_nonzero(known) < window:
        return np.zeros(value.size, bool)
    x = value[known]
    away = np.abs(x - signal.medfilt(x, window))
    spread = NORMAL * float(np.median(away)) + 1e-9 * (1.0 + float(np.ptp(x)))
    out = np.zeros(value.size, bool)
    out[known] = away > beyond * spread
    return out


def filled(value: Array, kept: Mask) -> Array:
    """The signal with rejected samples interpolated between means of their neighbours; raises ValueError if fewer than two are kept."""
    good = kept & np.isfinite(value)
    if np.count_nonzero(good) < 2:
        raise ValueError(f"only {np.count_nonzero(good)} of {value.size} samples can be used")
    if good.all():
        return value
    index = np.arange(value.size)
    smooth = uniform_filter1d(
        value[good], 2 * NEIGHBOURS + 1, mode="nearest"
    )  # one noisy neighbour would shift a whole gap
    return np.where(good, value, np.interp(index, index[good], smooth))


def long_gaps(kept: Mask, longest: int) -> Mask:
    """Samples inside runs of rejected ones that are longer than `longest`: interpolated values there would be arbitrary."""
    edges = np.diff(np.concatenate(([False], ~kept, [False])).astype(np.int8))
    out = np.zeros(kept.size, bool)
    for start, stop in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
        if stop - start > longest:
            out[start:stop] = True
    return out


def low_pass(value: Array, rate_hz: float, cutoff_hz: float = CUTOFF_HZ, order: int = ORDER) -> Array:
    """Butterworth, forwards and backwards: no delay, the amplitude squared."""
    sos = signal.butter(order, cutoff_hz, fs=rate_hz, output="sos")
    return np.asarray(signal.sosfiltfilt(sos, value), float)


def causal_low_pass(
    value: Array, rate_hz: float, cutoff_hz: float = CUTOFF_HZ, order: int = ORDER
) -> tuple[Array, float]:
    """Butterworth as a computer on a machine would run it, started in its steady state, and its delay of slow signals [s]."""
    sos = signal.butter(order, cutoff_hz, fs=rate_hz, output="sos")
    start = signal.sosfilt_zi(sos) * value[0]
    return np.asarray(signal.sosfilt(sos, value, zi=start)[0], float), low_pass_delay(cutoff_hz, order)


def low_pass_delay(cutoff_hz: float = CUTOFF_HZ, order: int = ORDER) -> float:
    """Group delay at zero frequency [s]: the sum of 2 sin over the poles' angles, over 2 pi times the cutoff."""
    angles = np.pi * (2.0 * np.arange(order) + 1.0) / (2.0 * order)
    return float(np.sum(np.sin(angles)) / (2.0 * np.pi * cutoff_hz))


def median(value: Array, window: int = 15) -> Array:
    """Running median over an odd number of samples; at the ends over the samples that exist."""
    return np.asarray(median_filter(value, size=window, mode="nearest"), float)


def unwrapped(angle: Array) -> Array:
    """An angle without its jumps by a turn [rad]; NaN is passed over."""
    out = np.asarray(angle, float).copy()
    known = np.isfinite(out)
    out[known] = np.unwrap(out[known])
    return out


def differentiated(value: Array, step: float) -> Array:
    """Central differences, one-sided at both ends (101)."""
    return np.asarray(np.gradient(value, step), float)


def averaged(value: Array, kept: Mask, block: int) -> tuple[Array, Array]:
    """Means of the kept samples in blocks (n // block,), and how many there were; NaN where none was."""
    n = value.size // block * block
    weight = kept[:n].reshape(-1, block).astype(float)
    count = weight.sum(axis=1)
    total = np.where(kept[:n], value[:n], 0.0).reshape(-1, block).sum(axis=1)
    return np.where(count > 0, total / np.maximum(count, 1.0), np.nan), count
