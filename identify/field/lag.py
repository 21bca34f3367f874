"""Slip behind the lag of the carcass over an event, for a curve and several compliances of the carcass."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from identify.tyre.transient import CARCASS, COLUMNS, response

Array = NDArray[np.float64]

COMPLIANCES: Final = 1e-6 * np.array([0.1, 0.3, 0.6, 0.9, 1.2, 1.6, 2.0, 2.5, 3.2, 4.0, 5.0, 6.0])
"""[m/N] Carcasses of 10 MN/m, which hardly lag, to 0.17 MN/m."""
SHORTEST_M: Final = 0.02  # relaxation length, for the time step of the events


def behind_carcass(curve: Array, slip: Array, speed: Array, step: float) -> Array:
    """Transient slip (compliances, n) of a wheel whose slip (n,) and speed over ground (n,) [m/s] are known at even steps [s].

    curve: of the Magic Formula (7,), as of `identify.tyre.parameters.curve`. The relaxation length is the slope of the curve at the transient
    slip times the compliance, so that a tyre returns from a large slip faster than it enters a small one.
    """
    n = slip.size
    nothing, unknown = np.zeros(n), np.full(n, np.nan)
    force, by = np.empty(n), np.empty((n, COLUMNS))
    out = np.empty((COMPLIANCES.size, n))
    for i, compliance in enumerate(COMPLIANCES.tolist()):
        response(
            CARCASS, 1.0 / compliance, SHORTEST_M, curve, speed, speed * (1.0 + slip), step, float(slip[0]),
            unknown, 1.0, 0.0, nothing, 1.0, True, nothing, out[i], force, by,
        )  # fmt: skip
    return out
