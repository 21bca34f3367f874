"""Angular rate and acceleration of lift arm and bucket, tracked from their sampled angles.

The angles come every second cycle with noise. A tracking filter with three equal poles gives rate and acceleration
without a step at each sample; between two samples it only predicts.
"""

from typing import NamedTuple

from ecu.estimators.compiled import compiled

BANDWIDTH = 15.0
"""Poles of the filter [rad/s]: 0.03 deg of noise gives 0.06 rad/s2, and a full lever's step is followed in 0.2 s."""
STEADY = 0.18
"""Largest pole times step: at 0.25 the filter swings with growing amplitude. Cycles that come late have slower poles."""
AWAY, FAST, HARD = 0.5, 3.0, 50.0
"""How far a tracked angle may be from the newest sample [rad], and how fast it may turn [rad/s, rad/s2]: twice what the cylinders do
and more. Where no new sample comes the filter predicts with its last acceleration; no bound of the machine would stop it."""
STILL = 0.02
"""Below this rate [rad/s] a part is taken to be at rest: four standard deviations of the tracked rate."""


EVEN = 0.2
"""Up to this acceleration [rad/s2] a part is taken to move evenly: three standard deviations of the tracked one."""


class Turning(NamedTuple):
    """Motion of a part about its pin on the front frame, upwards positive."""

    angle: float  # above the front frame's horizontal [rad]
    rate: float  # [rad/s]
    acceleration: float  # [rad/s2]
    sample: float  # the newest measured angle [rad]


@compiled
def possible(angle: float, rate: float, acceleration: float, sample: float) -> Turning:
    """A motion that the part can have."""
    return Turning(
        min(max(angle, sample - AWAY), sample + AWAY),
        min(max(rate, -FAST), FAST),
        min(max(acceleration, -HARD), HARD),
        sample,
    )


@compiled
def tracked(before: Turning, sample: float, dt: float) -> Turning:
    """The motion after `dt` [s] in which the angle `sample` [rad] arrived; an unchanged sample is not a new one."""
    rate = before.rate + before.acceleration * dt
    angle = before.angle + before.rate * dt + before.acceleration * dt * dt / 2.0
    if sample == before.sample:
        return possible(angle, rate, before.acceleration, sample)
    error, w, step = sample - angle, min(BANDWIDTH, STEADY / dt), 2.0 * dt
    return possible(
        angle + 3.0 * w * step * error,
        rate + 3.0 * w * w * step * error,
        before.acceleration + w * w * w * step * error,
        sample,
    )


@compiled
def accelerating(part: Turning) -> bool:
    """Whether the part accelerates more than noise does."""
    return abs(part.acceleration) > EVEN


@compiled
def moving(part: Turning) -> bool:
    """Whether the part turns faster than noise does."""
    return abs(part.rate) > STILL or accelerating(part)
