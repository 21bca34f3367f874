"""Transfers a state to a plant with slightly different parameters: the state is shifted by the difference of the two equilibria.

A heavier machine stands lower on its tyres. Started in the state of a lighter one it would bounce for seconds; shifted by the difference of
the equilibria it continues its motion. Compiled, because every change of a parameter in a diagnosis needs it.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plant.compiled import compiled, released
from plant.physics import state as s
from plant.physics.dynamics import derivative
from plant.physics.parameters import P_NORMAL
from plant.physics.workspace import Workspace

Array = NDArray[np.float64]

# A rest: attitude, oscillation, height of the joint over the road, and that of the start it belongs to.
R_ATTITUDE: Final = 0
R_OSCILLATION: Final = 4
R_HEIGHT: Final = 5
R_START: Final = 6
REST: Final = 7

UNKNOWNS: Final = 4  # height over the road, turn about the rear frame's x and y, oscillation
ITERATIONS: Final = 12
DIFFERENCE: Final = 1e-6  # [m, rad]
LONGEST: Final = 0.03  # change of one iteration [m, rad]
AT_REST: Final = 1e-6  # [m/s2, rad/s2]


@compiled
def product(a: Array, b: Array, out: Array) -> None:
    """Quaternion product a b."""
    w = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
    x = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2]
    y = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1]
    z = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]
    out[0], out[1], out[2], out[3] = w, x, y, z


@compiled
def road_attitude(yaw: float, p: Array) -> Array:
    """Quaternion of a rear frame that lies flat on the road, turned by `yaw` about its normal [rad]."""
    tilt = np.array((1.0 + p[P_NORMAL + 2], -p[P_NORMAL + 1], p[P_NORMAL], 0.0))
    tilt /= math.sqrt(np.sum(tilt * tilt))
    turn, flat = np.array((math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw))), np.empty(4)
    product(tilt, turn, flat)
    return flat


@compiled
def height(state: Array, p: Array) -> float:
    """Of the articulation joint over the road's plane [m]."""
    return (
        p[P_NORMAL] * state[s.POSITION]
        + p[P_NORMAL + 1] * state[s.POSITION + 1]
        + p[P_NORMAL + 2] * state[s.POSITION + 2]
    )


@compiled
def set_height(state: Array, p: Array, above: float) -> None:
    """Lift the state straight up until its joint is `above` the road's plane [m]."""
    below = p[P_NORMAL] * state[s.POSITION] + p[P_NORMAL + 1] * state[s.POSITION + 1]
    state[s.POSITION + 2] = (above - below) / p[P_NORMAL + 2]


@compiled
def _unrest(
    rest: Array, flat: Array, unknown: Array, command: Array, p: Array, work: Workspace, active: Array | None
) -> Array:
    """Accelerations that vanish at rest: along the road's normal, roll, pitch, oscillation."""
    set_height(rest, p, unknown[0])
    small = np.array((1.0, 0.5 * unknown[1], 0.5 * unknown[2], 0.0))
    small /= math.sqrt(np.sum(small * small))
    product(flat, small, rest[s.ATTITUDE : s.ATTITUDE + 4])
    rest[s.JOINT + s.REAR_AXLE] = unknown[3]
    derivative(rest, command, p, 0.0, work, active)
    rising = 0.0
    for i in range(3):
        rising += p[P_NORMAL + i] * work.rate[s.VELOCITY + i]
    return np.array(
        (
            rising,
            work.rate[s.ANGULAR],
            work.rate[s.ANGULAR + 1],
            work.rate[s.JOINT_RATE + s.REAR_AXLE],
        )
    )


@compiled
def rest_of(state: Array, above: float, p: Array, work: Workspace, active: Array | None, rest: Array) -> bool:
    """Fill `rest` with the machine of `state` at rest where it is, wheels free; whether it was found.

    above: height of the joint to begin the search at [m].
    """
    w, x, y, z = state[s.ATTITUDE], state[s.ATTITUDE + 1], state[s.ATTITUDE + 2], state[s.ATTITUDE + 3]
    flat = road_attitude(math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)), p)
    rest[:] = 0.0
    for i in range(2):
        rest[s.POSITION + i] = state[s.POSITION + i]
    for body in (s.FRONT_FRAME, s.LIFT_ARM, s.BUCKET):
        rest[s.JOINT + body] = state[s.JOINT + body]
    rest[s.STICK : s.STICK + 4] = 1.0
    rest[s.EXTRA :] = state[s.EXTRA :]
    command = np.zeros(s.COMMANDS)
    unknown, slopes = np.zeros(UNKNOWNS), np.empty((UNKNOWNS, UNKNOWNS))
    unknown[0] = above
    for _ in range(ITERATIONS):
        error = _unrest(rest, flat, unknown, command, p, work, active)
        if np.max(np.abs(error)) < AT_REST:
            return True
        for i in range(UNKNOWNS):
            moved = unknown.copy()
            moved[i] += DIFFERENCE
            slopes[:, i] = (_unrest(rest, flat, moved, command, p, work, active) - error) / DIFFERENCE
        if abs(np.linalg.det(slopes)) < 1e-9 or not math.isfinite(np.sum(slopes)):
            return False
        change = np.linalg.solve(slopes, error)
        unknown -= change / max(1.0, np.max(np.abs(change)) / LONGEST)
    return False


@released
def rest_records(starts: Array, p: Array, work: Workspace, active: Array | None, records: Array) -> None:
    """Fill (n, REST) with the rest of every start (n, STATES) on its own plant; not numbers where none was found."""
    rest = np.empty(s.STATES)
    for i in range(starts.shape[0]):
        records[i] = math.nan
        above = height(starts[i], p)
        if rest_of(starts[i], above, p, work, active, rest):
            records[i, R_ATTITUDE : R_ATTITUDE + 4] = rest[s.ATTITUDE : s.ATTITUDE + 4]
            records[i, R_OSCILLATION] = rest[s.JOINT + s.REAR_AXLE]
            records[i, R_HEIGHT], records[i, R_START] = height(rest, p), above


@compiled
def moved_to_rest(state: Array, record: Array, p: Array, work: Workspace, active: Array | None) -> None:
    """Move a state by what the rest of a plant with parameters p differs from the recorded rest of its own plant.

    A machine that finds no rest stays where it was.
    """
    own = np.empty(s.STATES)
    if math.isnan(record[R_HEIGHT]) or not rest_of(state, record[R_HEIGHT], p, work, active, own):
        return
    back, turn, turned = record[R_ATTITUDE : R_ATTITUDE + 4].copy(), np.empty(4), np.empty(4)
    back[1:] *= -1.0
    product(own[s.ATTITUDE : s.ATTITUDE + 4], back, turn)
    product(turn, state[s.ATTITUDE : s.ATTITUDE + 4], turned)
    state[s.ATTITUDE : s.ATTITUDE + 4] = turned
    velocity = np.zeros(4)
    velocity[1:] = state[s.VELOCITY : s.VELOCITY + 3]
    product(turn, velocity, turned)
    turn[1:] *= -1.0
    product(turned, turn, velocity)
    state[s.VELOCITY : s.VELOCITY + 3] = velocity[1:]
    set_height(state, p, record[R_START] + height(own, p) - record[R_HEIGHT])
    state[s.JOINT + s.REAR_AXLE] += own[s.JOINT + s.REAR_AXLE] - record[R_OSCILLATION]
