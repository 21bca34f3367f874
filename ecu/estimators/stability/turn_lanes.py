"""Least margins of many steady turns at once, side by side in the lanes of vectors: `steady.least_margin` (ADR 81).

The loads of a heading are computed in one loop over the lanes; slope and speed of the next heading, whose sine and cosine no vector
has, follow one by one.
"""

from typing import Any

import numpy as np

from ecu.estimators.compiled import compiled, inlined, side_by_side
from ecu.estimators.joint import Joint
from ecu.estimators.quantities import NormalForces, Vector
from ecu.estimators.stability.loading import divides, reloaded
from ecu.estimators.stability.rollover import LoadedMachine, margin, within_grip
from ecu.estimators.stability.steady import (
    TURN_STEP,
    SteadyTurns,
    headings_of,
    least_margin,
    slowed,
    steady_forces,
    turned_gravity,
)

LANES = 32
"""Turns in one loop; the lanes take 9 kB."""
FIELDS = 36
"""Numbers of a lane: what a heading changes 0 to 7, the steady turns 8 to 31, standing loads 32 to 35. Field f of lane j is at
f * LANES + j."""

Lanes = Any  # NDArray[np.float64], shape (FIELDS * LANES,)


@inlined
def forces_in(v: Lanes, field: int, j: int) -> NormalForces:
    """Loads of a lane. That of the pivot decides nothing here."""
    return NormalForces(
        v[field * LANES + j],
        v[(field + 1) * LANES + j],
        0.0,
        v[(field + 2) * LANES + j],
        v[(field + 3) * LANES + j],
    )


@inlined
def put_forces(v: Lanes, field: int, j: int, n: NormalForces) -> None:
    """Its counterpart."""
    v[field * LANES + j] = n.front_left
    v[(field + 1) * LANES + j] = n.front_right
    v[(field + 2) * LANES + j] = n.rear_left
    v[(field + 3) * LANES + j] = n.rear_right


@inlined
def turns_in(v: Lanes, j: int) -> SteadyTurns:
    """The steady turns of a lane."""
    return SteadyTurns(
        Joint(v[8 * LANES + j], v[9 * LANES + j], v[10 * LANES + j]),
        v[11 * LANES + j],
        forces_in(v, 12, j),
        forces_in(v, 16, j),
        forces_in(v, 20, j),
        forces_in(v, 24, j),
        forces_in(v, 28, j),
    )


@inlined
def put_turn(
    v: Lanes, j: int, floor: float, speed: float, turns: SteadyTurns, ground: Vector, standing: NormalForces
) -> None:
    """A turn before its first heading into a lane. Arguments as of `least_margin`; standing: loads of the straight machine [N]."""
    given = (
        speed, ground.x, ground.y, ground.z, 0.0, 1e9, 0.0, floor,
        turns.joint.angle, turns.joint.cosine, turns.joint.sine, turns.curvature,
    )  # fmt: skip
    for k in range(len(given)):
        v[k * LANES + j] = given[k]
    put_forces(v, 12, j, turns.rest)
    put_forces(v, 16, j, turns.ahead)
    put_forces(v, 20, j, turns.aside)
    put_forces(v, 24, j, turns.squared)
    put_forces(v, 28, j, turns.inward)
    put_forces(v, 32, j, standing)


@side_by_side
def judge(v: Lanes, n: int, m: LoadedMachine) -> None:
    """The yaw rate of n lanes (4), their least margin so far (5), and whether that decides (6)."""
    for j in range(n):
        speed, turns = v[j], turns_in(v, j)
        rate = within_grip(speed * turns.curvature, speed, m.wheel.lateral_peak)
        here = Vector(v[LANES + j], v[2 * LANES + j], v[3 * LANES + j])
        forces = steady_forces(speed, rate, turns, here, m)
        before, decided = v[5 * LANES + j], v[6 * LANES + j]
        least = min(before, margin(forces, forces_in(v, 32, j)).ratio)
        v[4 * LANES + j] = rate
        v[5 * LANES + j] = before if decided != 0.0 else least
        v[6 * LANES + j] = 1.0 if least < v[7 * LANES + j] or rate == 0.0 else decided


@compiled
def run_turns(v: Lanes, n: int, directions: Any, m: LoadedMachine) -> None:
    """n lanes through all their headings; directions: +1 forward, -1 reverse."""
    for _ in range(headings_of(m)):
        judge(v, n, m)
        turning = 0
        for j in range(n):
            if v[6 * LANES + j] == 0.0:
                turning += 1
                here = Vector(v[LANES + j], v[2 * LANES + j], v[3 * LANES + j])
                v[j] = slowed(v[j], directions[j], here, m)
                then = turned_gravity(here, v[4 * LANES + j] * TURN_STEP)
                v[LANES + j] = then.x
                v[2 * LANES + j] = then.y
        if turning == 0:
            return


@compiled
def least_margins(
    chosen: Any,
    floor: float,
    speeds: Any,
    turns: Any,
    grounds: Any,
    loadings: Any,
    m: LoadedMachine,
    found: Any,
) -> None:
    """The chosen of many least margins of one machine, each as `least_margin` gives it, into `found`. Errors as there.

    Lists with an entry for each row; arguments as of `least_margin`.
    """
    v, directions, rows = np.empty(FIELDS * LANES), np.empty(LANES), np.empty(LANES, np.int64)
    n = 0
    for k in range(len(speeds)):
        if chosen[k]:
            if divides(m, loadings[k]):
                put_turn(v, n, floor, speeds[k], turns[k], grounds[k], loadings[k].standing)
                directions[n] = 1.0 if speeds[k] >= 0.0 else -1.0
                rows[n] = k
                n += 1
            else:  # perhaps by zero: `least_margin` says whether
                found[k] = least_margin(floor, speeds[k], turns[k], grounds[k], reloaded(m, loadings[k]))
        if n == LANES or (k == len(speeds) - 1 and n > 0):
            run_turns(v, n, directions, m)
            for j in range(n):
                found[rows[j]] = v[5 * LANES + j]
            n = 0
