"""Ends of a profile-likelihood interval: where twice the log-likelihood has fallen by the 95 % quantile of chi-square (Venzon and Moolgavkar 1988)."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from scipy.stats import norm

NORMAL_95: Final = float(norm.ppf(0.975))
STEPS: Final = 10  # evaluations of the profile on each side
CLOSE: Final = 0.02  # of the root of the fall, at which an end is found
FURTHEST: Final = 3.0  # times the linear half width, beyond which no end is looked for


@dataclass(frozen=True, slots=True, kw_only=True)
class ProfileInterval:
    """95 % by the profile likelihood beside the linearised interval of the same noise; in the parameter's unit."""

    lower: float
    upper: float
    linear: tuple[float, float]

    @property
    def asymmetry(self) -> float:
        """Largest difference of an end from the linear one, over the linear half width."""
        half = 0.5 * (self.linear[1] - self.linear[0])
        return max(abs(self.lower - self.linear[0]), abs(self.upper - self.linear[1])) / half


def interval(
    fall: Callable[[float], float],
    at: float,
    sd: float,
    bounds: tuple[float, float],
    *,
    furthest: float = FURTHEST,
) -> ProfileInterval:
    """The interval about an estimate.

    fall: root of twice the log-likelihood lost with the parameter held at a value and the others fitted again; at, sd: the estimate and its
    linearised standard deviation; bounds: of the parameter, which are ends where the likelihood does not fall before them; furthest: times the
    linear half width, beyond which no end is looked for.
    """
    half = NORMAL_95 * sd

    def end(side: float, limit: float) -> float:
        last = min(abs(limit - at) / half, furthest)
        return at + side * half * _end(lambda share: fall(at + side * share * half), last)

    low, high = bounds
    return ProfileInterval(
        lower=max(end(-1.0, low), low), upper=min(end(1.0, high), high), linear=(at - half, at + half)
    )


def _end(fall: Callable[[float], float], last: float) -> float:
    """Where the fall reaches its 95 % quantile, in linear half widths, or `last` if it does not."""
    inside, outside, share = (0.0, 0.0), (math.inf, math.inf), min(1.0, last)
    for _ in range(STEPS):
        there = fall(share)
        if abs(there - NORMAL_95) < CLOSE:
            break
        if there < NORMAL_95:
            if share == last:
                break
            inside = (share, there)
        else:
            outside = (share, there)
        share = _between(inside, outside, last)
    return share


def _between(inside: tuple[float, float], outside: tuple[float, float], last: float) -> float:
    """Where to look next, given share and fall on either side: the fall is a power of the distance, 1 where the likelihood is a parabola."""
    if math.isinf(outside[0]):
        return min(last, inside[0] * min(max(NORMAL_95 / max(inside[1], 0.1), 1.2), 5.0))
    if inside[1] <= 0.0:
        return max(outside[0] * NORMAL_95 / outside[1], inside[0] + 0.05 * (outside[0] - inside[0]))
    power = math.log(outside[1] / inside[1]) / math.log(outside[0] / inside[0])
    wanted = inside[0] * (NORMAL_95 / inside[1]) ** (1.0 / power)
    margin = 0.02 * (outside[0] - inside[0])
    return min(max(wanted, inside[0] + margin), outside[0] - margin)
