"""Slope for the residuals: the inclination sensor's reading without what accelerations add to it, and how sure that is.

The correction is that of the estimators (`ecu.estimators.inclination`), from the median wheel's speed. It holds for a machine
that rolls on its wheels. The sensor's accelerometers also feel a shock, a fall from a kerb, a frame that swings on its tyres: for the residuals
of angles and rates the inertial sensor shows what they feel. An offset of an accelerometer would turn the
slope for ever, so that only what comes and goes is taken from there.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.detection.compiled import compiled
from ecu.detection.layout import (
    ACROSS,
    ALONG,
    F_LAST_SPEED,
    F_LAST_YAW,
    F_PITCH_LEAN,
    F_PITCH_SWING,
    F_PITCH_TAKEN,
    F_ROLL_LEAN,
    F_ROLL_SWING,
    F_ROLL_TAKEN,
    FILTERS,
    JUMPED,
    TOLERANCE,
)
from ecu.detection.machine import OBSERVED
from ecu.detection.motion import Motion
from ecu.detection.wheels import Wheels, drift
from ecu.detection_rules import Tolerances
from ecu.estimators.inclination import Slope, apparent, lean_at_start, leaned, without
from ecu.estimators.parameters import GRAVITY, Parameters
from ecu.watched import ANGLE, FORCE, PITCH, ROLL, ROLL_RATE, YAW_RATE

Floats = NDArray[np.float64]

LEAN_WRONG = 0.1
"""Share of the lean that its filter may have wrong: time constant, samples of another time."""
SWINGING = 1.0
"""Time in which a swing is forgotten [s]: longer than a frame swings on its tyres."""
STAYING = 10.0
"""Time over which what stays is taken for the offset of a sensor [s]: ten times as long as anything swings."""


class Lean(NamedTuple):
    """How wrong the corrected slope may be [rad]."""

    pitch: float
    roll: float


@compiled
def corrected(
    m: Floats, w: Wheels, q: Motion, p: Parameters, t: Tolerances, state: Floats, dt: float, started: bool
) -> tuple[Lean, Slope]:
    """Puts the corrected slope into the samples `m`; the correction's uncertainty, and what accelerometers show of this driving."""
    f, time = state[FILTERS], p.sensors.slope_levelling
    # a gyro's jump that may be a fault would move the prediction of the slope, and so explain itself
    yaw, v = m[YAW_RATE] - state[JUMPED, YAW_RATE], w.middle
    behind = p.geometry.rear_length + p.sensors.imu_x
    if not started:
        at_start = lean_at_start(yaw * v)
        f[F_PITCH_LEAN], f[F_ROLL_LEAN] = at_start.pitch, at_start.roll
        f[F_LAST_SPEED], f[F_LAST_YAW] = v, yaw
    lean = Slope(f[F_PITCH_LEAN], f[F_ROLL_LEAN])
    slope = without(Slope(m[PITCH], m[ROLL]), lean)
    ahead = (v - f[F_LAST_SPEED]) / dt - yaw * yaw * behind
    aside = yaw * v + (yaw - f[F_LAST_YAW]) / dt * behind
    after, rolled = leaned(lean, slope, ahead, aside, dt, time), apparent(slope, ahead, aside)
    f[F_PITCH_TAKEN], f[F_ROLL_TAKEN] = lean.pitch, lean.roll
    f[F_PITCH_LEAN], f[F_ROLL_LEAN] = after.pitch, after.roll
    f[F_LAST_SPEED], f[F_LAST_YAW] = v, yaw
    m[PITCH], m[ROLL] = slope.pitch, slope.roll
    # a speed that is wrong by so much, or slides aside by so much, leans the filter by that over its time
    pace = (time + dt) * GRAVITY
    slipping = abs(v) * (t.radius + (w.used + q.grip) / (p.wheel.slip_stiffness * (1.0 - t.stiffness)))
    slipping += drift(m[ANGLE], v, q)
    rolling = p.sensors.imu_z * abs(m[ROLL_RATE])  # its acceleration, over the filter's time
    found = Lean(
        LEAN_WRONG * abs(lean.pitch) + slipping / pace,
        LEAN_WRONG * abs(lean.roll) + (abs(v) * q.rear_slip + rolling) / pace,
    )
    return found, rolled


@compiled
def swinging(
    m: Floats,
    q: Motion,
    rolled: Slope,
    p: Parameters,
    t: Tolerances,
    rules: Floats,
    known: bool,
    state: Floats,
    dt: float,
) -> tuple[Slope, Lean]:
    """What accelerations beside those of driving add to the reading [rad], and how wrong that may be.

    rolled: what accelerometers would show of a machine that rolls on its wheels; known: whether those of the inertial sensor are
    sound. By the sensor's filter the reading lacks the integral
    of what they show beyond it, over the filter's time.
    """
    f, scale = state[FILTERS], p.sensors.slope_levelling + dt
    shown = inclination(m[FORCE], m[FORCE + 1], m[FORCE + 2])
    pitch_offset, roll_offset = rules[TOLERANCE, ALONG] / GRAVITY, rules[TOLERANCE, ACROSS] / GRAVITY
    pitch, roll = (shown.pitch - rolled.pitch) / scale, (shown.roll - rolled.roll) / scale
    missed_pitch = swung(state, F_PITCH_SWING, pitch, pitch_offset / scale, known, dt)
    missed_roll = swung(state, F_ROLL_SWING, roll, roll_offset / scale, known, dt)
    late = t.time / (scale * GRAVITY)
    return Slope(f[F_PITCH_SWING], f[F_ROLL_SWING]), Lean(
        LEAN_WRONG * abs(f[F_PITCH_SWING]) + missed_pitch + late * q.ahead,
        LEAN_WRONG * abs(f[F_ROLL_SWING]) + missed_roll + late * q.aside,
    )


@compiled
def inclination(fx: float, fy: float, fz: float) -> Slope:
    """The slope that accelerometers show of a machine that does not accelerate, by their specific force [m/s2]."""
    return Slope(math.atan2(-fx, math.sqrt(fy * fy + fz * fz)), math.atan2(fy, fz))


@compiled
def swung(state: Floats, place: int, rate: float, offset: float, known: bool, dt: float) -> float:
    """Update one swing, an integral of `rate` that forgets; returns how much what it has forgotten may still turn the slope [rad].

    offset: rate that sensors' offsets may make [rad/s]; known: whether `rate` is that of sound accelerometers.
    """
    f, missed, mean = state[FILTERS], place + 2, place + 4
    if not known:
        # only the offset is left: what came before is forgotten when the residual means something again
        f[place], f[missed] = f[mean] * SWINGING / OBSERVED, f[mean]
        return 0.0
    f[place] += dt * (rate - f[place] / SWINGING)
    # the observer adds up what was forgotten for as long as it remembers
    f[missed] += dt / OBSERVED * (f[place] * OBSERVED / SWINGING - f[missed])
    most = offset * OBSERVED
    apart = f[missed] - f[mean]
    # more than an offset can be is motion, and moves the mean no further
    f[mean] += dt / STAYING * min(max(apart, -most), most)
    return abs(apart)
