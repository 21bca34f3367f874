"""Synchronises two clocks, by a pulse and by the content of two records of the same motion, with drift and uncertainty.

other's time = offset + clock * (1 + drift), where `clock` is that of the encoder. Content needs no pulse and also sees a delay of the positions,
which a pulse on another wire does not.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from discrepancy.estimation.normal_equations import inverse

Array = NDArray[np.float64]

COARSE_S = 0.02  # grid of the search for a first offset
# An event does not follow the common clock if its offset differs by more than both of these.
OUTLIER = 6.0  # standard deviations
LEAST_S = 0.02
NEED = 3  # events that a common line needs: two for the line, one to check it


class Unsynchronised(ValueError):
    """The two records cannot be brought onto one clock; the message says why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sync:
    """One clock: offset [s], drift, their standard deviations, and events that do not follow it."""

    offset: float
    drift: float
    offset_sd: float
    drift_sd: float
    event_offset: Array  # of each event by itself, at its middle, minus the common line (e,) [s]; NaN without information
    event_sd: Array  # (e,) [s]
    lost: tuple[int, ...]
    by_pulse: float | None  # offset that the pulse says [s]

    def other(self, clock: Array) -> Array:
        """Time of the other system at times of this clock."""
        return self.offset + clock * (1.0 + self.drift)

    def sd_at(self, clock: float, middle: float) -> float:
        """Standard deviation of the other's time [s]; middle: of the clock over all events."""
        return float(np.hypot(self.offset_sd, self.drift_sd * (clock - middle)))


def first_pulse(time: Array, voltage: Array) -> float | None:
    """Time of the first rising edge [s], None where the sync vector has none."""
    known = np.isfinite(voltage)
    if not known.any() or np.ptp(voltage[known]) < 0.5:
        return None
    level = 0.5 * float(np.max(voltage[known]) + np.min(voltage[known]))
    up = np.flatnonzero((voltage[1:] >= level) & (voltage[:-1] < level))
    return float(time[up[0] + 1]) if up.size else None


def synchronised(
    events: Sequence[tuple[Array, Array]], clock: Array, angle: Array, speed: Array, pulse: float | None
) -> Sync:
    """The common clock. events: stamps and unwrapped wheel angle of each event; clock, angle, speed: of the encoder, unwrapped.

    Raises Unsynchronised if fewer than three events determine an offset, or if no offset fits.
    """
    guess = pulse if pulse is not None else _coarse(events, clock, speed)
    each = [_event(t, a, clock, angle, guess) for t, a in events]
    offset = np.array([e[0] for e in each])
    sd = np.array([e[1] for e in each])
    middle = np.array([float(np.mean(t)) for t, _ in events])
    good = np.isfinite(offset)
    if np.count_nonzero(good) < NEED:
        raise Unsynchronised(
            f"only {np.count_nonzero(good)} of {len(events)} events show where they lie in the encoder's record; {NEED} are needed"
        )
    line, kept = _line(middle - guess, offset, sd, good)
    left = offset - (line[0] + line[1] * (middle - guess))
    lost = tuple(int(i) for i in np.flatnonzero(~kept))
    if len(lost) > len(events) // 2:
        raise Unsynchronised(
            f"{len(lost)} of {len(events)} events do not follow a common clock: was the logger restarted, or is it another drive?"
        )
    J = np.stack([np.ones(int(kept.sum())), middle[kept] - guess], axis=1) / sd[kept][:, None]
    excess = max(1.0, float(np.sum((left[kept] / sd[kept]) ** 2)) / max(int(kept.sum()) - 2, 1))
    covariance = inverse(J.T @ J) * excess
    at = float(np.mean(middle[kept] - guess))
    at_middle = covariance[0, 0] + 2.0 * at * covariance[0, 1] + at * at * covariance[1, 1]
    return Sync(
        offset=float(line[0]),
        drift=float(line[1]),
        offset_sd=float(np.sqrt(at_middle)),
        drift_sd=float(np.sqrt(covariance[1, 1])),
        event_offset=left,
        event_sd=sd,
        lost=lost,
        by_pulse=pulse,
    )


def _coarse(events: Sequence[tuple[Array, Array]], clock: Array, speed: Array) -> float:
    """Offset [s] by correlation of the wheel's speed, known in events only."""
    step = COARSE_S
    end = max(float(t[-1]) for t, _ in events)
    grid = np.arange(0.0, end + step, step)
    mine, there = np.zeros(grid.size), np.zeros(grid.size)
    for t, a in events:
        part = (grid > t[0] + 0.1) & (grid < t[-1] - 0.1)
        mine[part] = np.gradient(np.interp(grid[part], t, a), step)
        there[part] = 1.0
    theirs = np.interp(np.arange(0.0, clock[-1], step), clock, speed)
    size = 1 << int(np.ceil(np.log2(grid.size + theirs.size)))

    def correlated(a: Array, b: Array) -> Array:
        return np.fft.irfft(np.fft.rfft(a, size) * np.conj(np.fft.rfft(b, size)), size)

    # sum over events of (mine - theirs shifted)^2: the smallest is the offset
    misfit = correlated(there, theirs**2) - 2.0 * correlated(mine, theirs)
    covered = correlated(there, np.ones(theirs.size))
    misfit = np.where(covered > 0.9 * there.sum(), misfit, np.inf)
    at = int(np.argmin(misfit))
    return float((at if at < size // 2 else at - size) * step)


def _event(t: Array, a: Array, clock: Array, angle: Array, guess: float) -> tuple[float, float]:
    """Offset of one event by itself [s] and its standard deviation; NaN where the wheel's speed does not change."""
    best: tuple[float, float, float] | None = None
    # several starts: an angle that turns repeats its form, so the misfit over the shift has many local minima
    for start in (0.0, -0.1, 0.1, -0.4, 0.4, -0.8, 0.8):

        def residual(x: Array) -> Array:
            return np.interp(t - guess - x[0], clock, angle) - a - x[1]

        first = float(np.median(residual(np.array([start, 0.0]))))
        found = least_squares(
            residual,
            [start, first],
            loss="soft_l1",
            f_scale=0.01,
            diff_step=[1e-4, 1e-4],
            x_scale=[0.01, 0.01],
        )
        if best is None or found.cost < best[0]:
            J = np.asarray(found.jac, float)
            e = residual(found.x)
            spread = 1.4826 * float(np.median(np.abs(e - np.median(e))))
            # encoder and markers both err slowly: neighbours within 20 samples count once
            variance = 20.0 * max(spread, 1e-4) ** 2 * inverse(J.T @ J)[0, 0]
            best = (float(found.cost), float(found.x[0]), float(np.sqrt(variance)))
    assert best is not None
    _, shift, sd = best
    return (guess + shift, sd) if 0.0 < sd < 0.1 else (float("nan"), float("nan"))


def _line(time: Array, offset: Array, sd: Array, good: NDArray[np.bool_]) -> tuple[Array, NDArray[np.bool_]]:
    """Offset and drift through events that follow one clock; others are left out, the worst first."""
    kept = good.copy()
    line = np.zeros(2)
    while True:
        rows = np.stack([np.ones(int(kept.sum())), time[kept]], axis=1) / sd[kept][:, None]
        # prior of the drift, 3e-4: clocks are better than 1e-3, and few events would turn their noise into a drift
        rows = np.vstack([rows, [0.0, 1.0 / 3e-4]])
        line = np.linalg.lstsq(rows, np.append(offset[kept] / sd[kept], 0.0), rcond=None)[0]
        left = np.abs(offset - line[0] - line[1] * time)
        allowed = np.maximum(OUTLIER * sd, LEAST_S)
        worst = np.where(kept, left / allowed, 0.0)
        if worst.max() <= 1.0 or kept.sum() <= NEED:
            return np.asarray(line, float), kept
        # drop the event furthest from the median: unlike the line, a single outlier does not move the median
        away = np.where(kept, np.abs(offset - np.median(offset[kept])), 0.0)
        kept[int(np.argmax(away))] = False
