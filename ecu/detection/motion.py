"""How hard the machine moves: what bounds the terms that the residuals' equations leave out.

An equation between signals holds for a machine whose tyres neither slip sideways nor saturate, whose signals are of one
time, and whose parts do not accelerate against one another. How far it does not is bounded by how quickly the signals
change and by how much of their grip the tyres use.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.detection.compiled import compiled
from ecu.detection.layout import (
    AHEAD,
    ASIDE,
    GRIPPING,
    JOINT,
    LIFTING,
    LINES,
    MOTION,
    PEAKS,
    PITCHING,
    QUICKS,
    ROLLING_RATE,
    SPEED,
    TILTING,
    UPRIGHT,
    YAWING,
)
from ecu.detection.machine import turning_shares
from ecu.detection_rules import Tolerances
from ecu.estimators.parameters import GRAVITY, Parameters
from ecu.watched import (
    FORCE,
    LEFT_LINE,
    LIFT,
    PITCH_RATE,
    RATE,
    RIGHT_LINE,
    ROLL_RATE,
    TILT,
    YAW_RATE,
)

Floats = NDArray[np.float64]

CHANGING = 0.05
"""Time over which a change is taken [s]: long enough for noise, short enough for the joint's acceleration."""
FELT = 0.3
"""How long a change is remembered [s]: that of the filters of the accelerations."""
SLIPPERY = 0.35
"""The least friction of ground on which the bounds hold."""
LIMIT = 0.75
"""Share of that friction from which on a tyre's slip is not known."""


class Motion(NamedTuple):
    """Recent changes per CHANGING, as rates [1/s], and what the tyres give way."""

    joint: float  # acceleration of the articulation [rad/s2]
    roll: float  # angular accelerations of the rear unit [rad/s2]
    pitch: float
    yaw: float
    speed: float  # acceleration by the wheels [m/s2]
    grip: float  # change of traction over load, not per second
    ahead: float  # changes of the specific force [m/s2], not per second
    aside: float
    upright: float
    lifting: float  # changes of pressures [Pa], not per second
    tilting: float
    lines: float
    side: float  # lateral force over load
    moved: float  # share of a wheel's standing load that may have moved to others
    sideslip: float  # of an axle that turns the machine no faster, at most [rad]
    front_slip: float  # sideslip of the front axle, at most, what turns the machine faster included [rad]
    rear_slip: float  # ... of the rear axle
    known: bool  # whether every tyre is far from its limit


@compiled
def changes(m: Floats, speed: float, used: float, state: Floats, dt: float, started: bool) -> None:
    """Update the quick means and how far the signals were from them lately."""
    now = np.empty(QUICKS)
    now[JOINT], now[ROLLING_RATE], now[PITCHING], now[YAWING] = (
        m[RATE],
        m[ROLL_RATE],
        m[PITCH_RATE],
        m[YAW_RATE],
    )
    now[SPEED], now[GRIPPING] = speed, used
    now[AHEAD], now[ASIDE], now[UPRIGHT] = m[FORCE], m[FORCE + 1], m[FORCE + 2]
    now[LIFTING], now[TILTING] = m[LIFT], m[TILT]
    now[LINES] = max(m[LEFT_LINE], m[RIGHT_LINE])
    share, fade = dt / (CHANGING + dt), math.exp(-dt / FELT)
    for i in range(QUICKS):
        if not started:
            state[MOTION, i] = now[i]
        state[MOTION, i] += share * (now[i] - state[MOTION, i])
        state[PEAKS, i] = max(abs(now[i] - state[MOTION, i]), fade * state[PEAKS, i])


@compiled
def motion(
    m: Floats,
    speed: float,
    used: float,
    payload: float,
    p: Parameters,
    t: Tolerances,
    state: Floats,
    dt: float,
    started: bool,
) -> Motion:
    """How the machine moves in this cycle. used: largest traction of a wheel over its standing load; payload: [kg]."""
    changes(m, speed, used, state, dt, started)
    peak, g = state[PEAKS], p.geometry
    # the units push each other sideways when the joint or the machine turns faster
    turning = (peak[YAWING] + peak[JOINT]) / CHANGING * g.front_length / 4.0
    side = (abs(state[MOTION, ASIDE]) + peak[ASIDE] + turning) / GRAVITY
    ahead = (abs(state[MOTION, AHEAD]) + peak[AHEAD]) / GRAVITY
    height, track = p.rear.z, min(g.front_track, g.rear_track)
    moved = min(2.0 * side * height / track + ahead * height / (g.front_length + g.rear_length), 0.8)
    all_used = math.hypot(used / (1.0 - moved), side)
    stiffness, yaw = p.wheel.cornering_stiffness * (1.0 - t.stiffness), peak[YAWING] / CHANGING
    front_share, rear_share = turning_shares(payload, p)
    return Motion(
        peak[JOINT] / CHANGING,
        peak[ROLLING_RATE] / CHANGING,
        peak[PITCHING] / CHANGING,
        yaw,
        peak[SPEED] / CHANGING,
        peak[GRIPPING],
        peak[AHEAD],
        peak[ASIDE],
        peak[UPRIGHT],
        peak[LIFTING],
        peak[TILTING],
        peak[LINES],
        side,
        moved,
        slip_of(side, stiffness),
        slip_of(side + front_share * yaw, stiffness),
        slip_of(side + rear_share * yaw, stiffness),
        all_used < LIMIT * SLIPPERY,
    )


@compiled
def slip_of(used: float, stiffness: float) -> float:
    """Slip, longitudinal or lateral, at which a tyre gives a force of `used` times its load on slippery ground.

    The brush model: F = mu Fz (1 - (1 - C s / 3 mu)^3), solved for s; the linear slip at small forces.
    """
    share = min(used / SLIPPERY, 1.0)
    return 3.0 * SLIPPERY / stiffness * (1.0 - (1.0 - share) ** (1.0 / 3.0))
