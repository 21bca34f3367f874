"""Slope for the residuals: the inclination sensor's reading without what accelerations add to it, and how sure that is.

The correction is that of the estimators (`ecu.estimators.inclination`), from the median wheel's speed.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.detection.compiled import compiled
from ecu.detection.layout import (
    F_LAST_SPEED,
    F_LAST_YAW,
    F_PITCH_LEAN,
    F_PITCH_TAKEN,
    F_ROLL_LEAN,
    F_ROLL_TAKEN,
    FILTERS,
)
from ecu.detection.motion import Motion
from ecu.detection.wheels import Wheels
from ecu.detection_rules import Tolerances
from ecu.estimators.inclination import Slope, lean_at_start, leaned, without
from ecu.estimators.parameters import GRAVITY, Parameters
from ecu.watched import PITCH, ROLL, ROLL_RATE, YAW_RATE

Floats = NDArray[np.float64]

LEAN_WRONG = 0.1
"""Share of the lean that its filter may have wrong: time constant, samples of another time."""


class Lean(NamedTuple):
    """How wrong the corrected slope may be [rad]."""

    pitch: float
    roll: float


@compiled
def corrected(
    m: Floats, w: Wheels, q: Motion, p: Parameters, t: Tolerances, state: Floats, dt: float, started: bool
) -> tuple[Floats, Lean]:
    """The samples with the corrected slope in them, and the correction's uncertainty."""
    f, time = state[FILTERS], p.sensors.slope_levelling
    yaw, v = m[YAW_RATE], w.middle
    behind = p.geometry.rear_length + p.sensors.imu_x
    if not started:
        at_start = lean_at_start(yaw * v)
        f[F_PITCH_LEAN], f[F_ROLL_LEAN] = at_start.pitch, at_start.roll
        f[F_LAST_SPEED], f[F_LAST_YAW] = v, yaw
    lean = Slope(f[F_PITCH_LEAN], f[F_ROLL_LEAN])
    slope = without(Slope(m[PITCH], m[ROLL]), lean)
    ahead = (v - f[F_LAST_SPEED]) / dt - yaw * yaw * behind
    after = leaned(lean, slope, ahead, yaw * v + (yaw - f[F_LAST_YAW]) / dt * behind, dt, time)
    f[F_PITCH_TAKEN], f[F_ROLL_TAKEN] = lean.pitch, lean.roll
    f[F_PITCH_LEAN], f[F_ROLL_LEAN] = after.pitch, after.roll
    f[F_LAST_SPEED], f[F_LAST_YAW] = v, yaw
    freed = m.copy()
    freed[PITCH], freed[ROLL] = slope.pitch, slope.roll
    # a speed that is wrong by so much, or slides aside by so much, leans the filter by that over its time
    pace = (time + dt) * GRAVITY
    slipping = abs(v) * (t.radius + (w.used + q.grip) / (p.wheel.slip_stiffness * (1.0 - t.stiffness)))
    rolling = p.sensors.imu_z * abs(m[ROLL_RATE])  # its acceleration, over the filter's time
    return freed, Lean(
        LEAN_WRONG * abs(lean.pitch) + slipping / pace,
        LEAN_WRONG * abs(lean.roll) + (abs(v) * q.sideslip + rolling) / pace,
    )
