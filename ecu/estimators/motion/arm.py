"""Angular rate and acceleration of lift arm and bucket, tracked from their sampled angles.

The angles come every second cycle with noise. A tracking filter with three equal poles gives rate and acceleration
without a step at each sample; between two samples it only predicts.
"""

from typing import NamedTuple

from ecu.estimators.compiled import compiled

BANDWIDTH = 15.0
"""Poles of the filter [rad/s]: 0.03 deg of noise gives 0.06 rad/s2, and a full lever's step is followed in 0.2 s."""
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
def tracked(before: Turning, sample: float, dt: float) -> Turning:
    """The motion after `dt` [s] in which the angle `sample` [rad] arrived; an unchanged sample is not a new one."""
    rate = before.rate + before.acceleration * dt
    angle = before.angle + before.rate * dt + before.acceleration * dt * dt / 2.0
    if sample == before.sample:
        return Turning(angle, rate, before.acceleration, sample)
    error, w, step = sample - angle, BANDWIDTH, 2.0 * dt
    return Turning(
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
