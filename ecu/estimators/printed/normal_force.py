"""Normal forces of the tyres by the thesis' printed balances (71)-(87), as solved and letter by letter.

Absolute distances (86), (87); half the height of the pivot in both balances (E-16, E-17); no arm of the pivot's
force (E-15). Thesis' frame inside: y to the right.
"""

import math
from typing import NamedTuple

from ecu.estimators.compiled import compiled
from ecu.estimators.parameters import Geometry
from ecu.estimators.quantities import Centre, NormalForces


class PrintedArms(NamedTuple):
    """Absolute distances (86), (87) from the CoG to front left, front right and rear wheels [m]."""

    a1: float
    a2: float
    ar: float
    b1: float
    b2: float


@compiled
def printed_arms(centre: Centre, articulation_angle: float, geometry: Geometry) -> PrintedArms:
    """(86), (87) with the wheels of (43)-(46), both turned the same way (without E-09)."""
    c, s = math.cos(articulation_angle), math.sin(articulation_angle)
    lf, half = geometry.front_length, geometry.front_track / 2.0
    return PrintedArms(
        abs(centre.x - (lf * c - half * s)),
        abs(centre.x - (lf * c + half * s)),
        abs(centre.x + geometry.rear_length),
        abs(centre.y - (lf * s + half * c)),
        abs(centre.y - (lf * s - half * c)),
    )


@compiled
def printed_normal_forces(
    mass: float,
    height: float,
    arms: PrintedArms,
    ax: float,
    ay_right: float,
    pitch: float,
    roll: float,
    gravity: float,
    axle_mass: float,
    axle_height: float,
    rear_half_track: float,
    pivot_height: float,
) -> NormalForces:
    """Solution of the printed equations (71), (79), (80), (82), (85), in the thesis' frame (y right).

    mass, height: everything but the rear axle; ax, ay_right: v'_x and v'_y [m/s2]; pitch theta, nose
    up +; roll psi, right side up + [rad]. (88)-(92) with theta and psi interchanged (E-14), and (85)
    with the sign it was solved with (E-20).
    """
    forward = ax + gravity * math.sin(pitch)
    right = ay_right + gravity * math.sin(roll)
    weight = gravity * math.cos(roll) * math.cos(pitch)
    return _printed_solution(
        mass, height, arms, forward, right, weight, gravity * math.cos(roll),
        axle_mass, axle_height, rear_half_track, pivot_height,
    )  # fmt: skip


@compiled
def printed_normal_forces_literal(
    mass: float,
    height: float,
    arms: PrintedArms,
    ax: float,
    ay_right: float,
    pitch: float,
    roll: float,
    gravity: float,
    axle_mass: float,
    axle_height: float,
    rear_half_track: float,
    pivot_height: float,
) -> NormalForces:
    """(88)-(92) letter by letter: v'_y goes with sin(theta), v'_x with sin(psi) (E-14), the axle's
    weight with cos(theta). Grade then acts on the roll balance and bank on the pitch balance."""
    forward = ax + gravity * math.sin(roll)
    right = ay_right + gravity * math.sin(pitch)
    weight = gravity * math.cos(roll) * math.cos(pitch)
    return _printed_solution(
        mass, height, arms, forward, right, weight, gravity * math.cos(pitch),
        axle_mass, axle_height, rear_half_track, pivot_height,
    )  # fmt: skip


@compiled
def _printed_solution(
    mass: float,
    height: float,
    arms: PrintedArms,
    forward: float,
    right: float,
    weight: float,
    axle_weight: float,
    axle_mass: float,
    axle_height: float,
    rear_half_track: float,
    pivot_height: float,
) -> NormalForces:
    a1, a2, ar, b1, b2 = arms.a1, arms.a2, arms.ar, arms.b1, arms.b2
    lever = 2.0 * height - pivot_height
    scale = mass / (2.0 * (a1 * b2 + a2 * b1 + ar * b1 + ar * b2))
    n1 = scale * (lever * ((a2 + ar) * right - b2 * forward) + 2.0 * ar * b2 * weight)
    n2 = scale * (-lever * ((a1 + ar) * right + b1 * forward) + 2.0 * ar * b1 * weight)
    pivot = scale * (lever * ((a1 - a2) * right + (b1 + b2) * forward) + 2.0 * (a1 * b2 + a2 * b1) * weight)
    moment = (mass * pivot_height / 2.0 + axle_mass * axle_height) * right
    rear = (pivot + axle_mass * axle_weight) / 2.0
    shift = moment / (2.0 * rear_half_track)
    return NormalForces(n1, n2, pivot, rear + shift, rear - shift)
