"""Position and velocity of what moves, from its positions: Kalman filter, Rauch-Tung-Striebel smoother, noise by likelihood.

The state is (position, velocity) with a white acceleration (thesis (128)-(137), with E-28 and E-29 corrected). Stamps may be uneven
and values may be missing: the filter predicts over what is not there. Where the thesis tuned `sigma vel` by hand for every signal,
the likelihood of the recording chooses how strongly it accelerates and how noisy it is.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from identify.compiled import compiled

Array = NDArray[np.float64]

UNKNOWN = 1e6  # variance of the state at the start over that of a reading
LOST = 5  # readings in a row beyond the gate: then the filter errs, not the readings, and the next one counts


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """Smoothed position and velocity with standard deviations (n,), and the noises by which they were found."""

    position: Array
    velocity: Array
    position_sd: Array
    velocity_sd: Array
    acceleration_density: float  # of the white acceleration, [unit²/s³]
    reading_sd: float  # of one reading, in its unit
    rejected: NDArray[np.bool_]  # readings beyond `gate` standard deviations of their prediction (n,)


@compiled
def _filter(
    time: Array,
    z: Array,
    q: float,
    r: float,
    gate: float,
    x: Array,
    p: Array,
    px: Array,
    pp: Array,
    used: Array,
) -> float:
    """Filtered states x (n, 2), variances p (n, 3), both predicted (px, pp); returns -2 log-likelihood."""
    cost, known, missed = 0.0, 0, 0
    x0, x1, p00, p01, p11 = 0.0, 0.0, UNKNOWN * r, 0.0, UNKNOWN * r * 100.0
    for k in range(z.size):
        if k > 0:
            dt = time[k] - time[k - 1]
            x0 += dt * x1
            p00 += dt * (2.0 * p01 + dt * p11) + q * dt**3 / 3.0
            p01 += dt * p11 + q * dt * dt / 2.0
            p11 += q * dt
        px[k, 0], px[k, 1], pp[k, 0], pp[k, 1], pp[k, 2] = x0, x1, p00, p01, p11
        used[k] = 0.0
        if not np.isnan(z[k]):
            if known == 0:
                x0, px[k, 0] = z[k], z[k]
            e, s = z[k] - x0, p00 + r
            # without the way back, noises that are far too small gate out nearly all readings, and are cheap
            if known < 3 or e * e < gate * gate * s or missed >= LOST:
                known, missed = known + 1, 0
                used[k] = 1.0
                cost += np.log(s) + e * e / s
                g0, g1 = p00 / s, p01 / s
                x0, x1 = x0 + g0 * e, x1 + g1 * e
                p11 -= g1 * p01
                p01 -= g0 * p01
                p00 -= g0 * p00
            else:
                missed += 1
                cost += np.log(s) + gate * gate
        x[k, 0], x[k, 1], p[k, 0], p[k, 1], p[k, 2] = x0, x1, p00, p01, p11
    return cost


@compiled
def _smooth(time: Array, q: float, x: Array, p: Array, px: Array, pp: Array) -> None:
    """Rauch-Tung-Striebel: filtered x and p become smoothed ones."""
    for k in range(time.size - 2, -1, -1):
        dt = time[k + 1] - time[k]
        a, b, c = pp[k + 1, 0], pp[k + 1, 1], pp[k + 1, 2]
        det = a * c - b * b
        # C = P A' inv(P predicted), A = [[1, dt], [0, 1]]
        m00, m01 = p[k, 0] + dt * p[k, 1], p[k, 1]
        m10, m11 = p[k, 1] + dt * p[k, 2], p[k, 2]
        c00, c01 = (m00 * c - m01 * b) / det, (m01 * a - m00 * b) / det
        c10, c11 = (m10 * c - m11 * b) / det, (m11 * a - m10 * b) / det
        e0, e1 = x[k + 1, 0] - px[k + 1, 0], x[k + 1, 1] - px[k + 1, 1]
        x[k, 0] += c00 * e0 + c01 * e1
        x[k, 1] += c10 * e0 + c11 * e1
        d0, d1, d2 = p[k + 1, 0] - a, p[k + 1, 1] - b, p[k + 1, 2] - c
        p[k, 0] += c00 * c00 * d0 + 2.0 * c00 * c01 * d1 + c01 * c01 * d2
        p[k, 1] += c00 * c10 * d0 + (c00 * c11 + c01 * c10) * d1 + c01 * c11 * d2
        p[k, 2] += c10 * c10 * d0 + 2.0 * c10 * c11 * d1 + c11 * c11 * d2


def motion(
    time: Array, position: Array, *, gate: float = 6.0, noise: tuple[float, float] | None = None
) -> Motion:
    """Smoothed motion of readings (n,) at ascending stamps [s]; NaN is no reading.

    noise: acceleration density and standard deviation of a reading, where they are known; else those of greatest likelihood.
    Raises ValueError with fewer than four readings: their noise cannot be estimated.
    """
    there = np.flatnonzero(np.isfinite(position))
    if there.size < 4:
        raise ValueError(f"{there.size} readings are too few to smooth; at least 4 are needed")
    if np.any(np.diff(time) <= 0.0):
        raise ValueError("stamps must ascend; mend the time base first")
    work = (
        np.empty((time.size, 2)),
        np.empty((time.size, 3)),
        np.empty((time.size, 2)),
        np.empty((time.size, 3)),
        np.empty(time.size),
    )
    q, r = (noise[0], noise[1] ** 2) if noise is not None else _likeliest(time, position, gate)
    x, p, px, pp, used = work
    _filter(time, position, q, r, gate, x, p, px, pp, used)
    _smooth(time, q, x, p, px, pp)
    return Motion(
        position=x[:, 0],
        velocity=x[:, 1],
        position_sd=np.sqrt(np.maximum(p[:, 0], 0.0)),
        velocity_sd=np.sqrt(np.maximum(p[:, 2], 0.0)),
        acceleration_density=q,
        reading_sd=float(np.sqrt(r)),
        rejected=np.isfinite(position) & (used == 0.0),
    )


def _likeliest(time: Array, z: Array, gate: float, most: int = 4000) -> tuple[float, float]:
    """Density and variance of greatest likelihood, on the first `most` samples around the middle of what is there."""
    there = np.flatnonzero(np.isfinite(z))
    middle = max(0, min(int(there[there.size // 2]) - most // 2, time.size - most))
    t, y = time[middle : middle + most], z[middle : middle + most]
    work = (
        np.empty((t.size, 2)),
        np.empty((t.size, 3)),
        np.empty((t.size, 2)),
        np.empty((t.size, 3)),
        np.empty(t.size),
    )
    seen = y[np.isfinite(y)]
    second = np.diff(seen, 2)
    rough = max(float(np.median(np.abs(second))) / 0.6745 / np.sqrt(6.0), 1e-9 * (1.0 + float(np.ptp(seen))))
    step = float(np.median(np.diff(t)))

    def cost(v: Array) -> float:
        return float(_filter(t, y, float(np.exp(v[0])), float(np.exp(v[1])), gate, *work))

    start = np.array([np.log((rough / step) ** 2 * 1e-2 + 1e-12), 2.0 * np.log(rough)])
    found = minimize(cost, start, method="Nelder-Mead", options={"xatol": 0.02, "fatol": 0.1, "maxiter": 120})
    return float(np.exp(found.x[0])), float(np.exp(found.x[1]))
