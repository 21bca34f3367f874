"""Steady turns of the machine on a slope, on tyres that give way, and the least margin while it slows down in one.

At one articulation angle the loads of a steady turn are linear in the ground's slope and in the turn's accelerations. The
unit loads are computed once; a speed or a heading then costs a weighted sum. ISO 8855, rear frame axes.
"""

import math
from typing import NamedTuple

from ecu.estimators.compiled import compiled
from ecu.estimators.joint import Joint, joint_at
from ecu.estimators.loads.arm_forces import NO_ARM_FORCES
from ecu.estimators.loads.normal_force import normal_forces
from ecu.estimators.motion.acceleration import joint_acceleration, yaw_rate
from ecu.estimators.quantities import NormalForces, Vector
from ecu.estimators.stability.rollover import LoadedMachine, loads_of, margin, within_grip
from ecu.estimators.tyres.contact import Tilt, tilt_of

TURN_STEP = 0.5
"""Time between two judged headings [s]: at 0.3 g and 10 km/h the machine turns by 30 degrees in it."""


class SteadyTurns(NamedTuple):
    """Steady turns at one articulation angle: the loads of rest, and what slope and turn add to them."""

    joint: Joint
    curvature: float  # yaw rate over speed [1/m], of tyres that do not slip
    rest: NormalForces  # of the machine at rest, its weight square to the ground [N]
    ahead: NormalForces  # added per specific force of rest along x [N per m/s2]
    aside: NormalForces  # ... along y
    squared: NormalForces  # added per square of the yaw rate [N per rad2/s2]
    inward: NormalForces  # added per speed times yaw rate [N per m/s2]


@compiled
def leaned(gravity: Vector, tilt: Tilt) -> Vector:
    """The specific force of rest [m/s2] in axes that are tilted by a small angle (roll left up, pitch nose down)."""
    return Vector(gravity.x - gravity.z * tilt.pitch, gravity.y + gravity.z * tilt.roll, gravity.z)


@compiled
def turned_gravity(gravity: Vector, angle: float) -> Vector:
    """Specific force at rest once the machine has turned left by `angle` [rad] on the same slope."""
    c, s = math.cos(angle), math.sin(angle)
    return Vector(gravity.x * c + gravity.y * s, gravity.y * c - gravity.x * s, gravity.z)


@compiled
def with_more(forces: NormalForces, share: float, more: NormalForces) -> NormalForces:
    """Forces and a share of others."""
    return NormalForces(
        forces.front_left + share * more.front_left,
        forces.front_right + share * more.front_right,
        forces.pivot + share * more.pivot,
        forces.rear_left + share * more.rear_left,
        forces.rear_right + share * more.rear_right,
    )


@compiled
def rolling_loads(
    joint_x: float, joint_y: float, rate: float, joint: Joint, gravity: Vector, m: LoadedMachine
) -> NormalForces:
    """Normal forces at a constant articulation angle and yaw rate [rad/s], on hard tyres; joint_x, joint_y [m/s2]."""
    loads = loads_of(
        joint_x, joint_y, rate, 0.0, joint, 0.0, 0.0, gravity, m.front, m.rear, m.axle, m.geometry,
        NO_ARM_FORCES,
    )  # fmt: skip
    return normal_forces(loads.support, joint, loads.axle_load, loads.axle_moment, m.geometry)


@compiled
def steady_turns(angle: float, weight: float, m: LoadedMachine) -> SteadyTurns:
    """Steady turns at this articulation angle [rad]; weight: specific force of rest along z [m/s2]."""
    joint, level = joint_at(angle), Vector(0.0, 0.0, weight)
    rest = rolling_loads(0.0, 0.0, 0.0, joint, level, m)
    along, across = joint_acceleration(0.0, 0.0, 1.0, 0.0, m.geometry)
    return SteadyTurns(
        joint,
        yaw_rate(1.0, angle, 0.0, m.geometry),
        rest,
        with_more(rolling_loads(0.0, 0.0, 0.0, joint, Vector(1.0, 0.0, weight), m), -1.0, rest),
        with_more(rolling_loads(0.0, 0.0, 0.0, joint, Vector(0.0, 1.0, weight), m), -1.0, rest),
        with_more(rolling_loads(along, across, 1.0, joint, level, m), -1.0, rest),
        with_more(rolling_loads(0.0, 1.0, 0.0, joint, level, m), -1.0, rest),
    )


@compiled
def steady_forces(
    speed: float, rate: float, turns: SteadyTurns, ground: Vector, m: LoadedMachine
) -> NormalForces:
    """Normal forces of a steady turn on tyres that give way: the machine leans to its outer side and its weight with it.

    speed: [m/s], reverse negative; rate: of yaw [rad/s]; ground: specific force of rest in axes of the ground [m/s2].
    """
    upright = with_more(with_more(turns.rest, rate * rate, turns.squared), speed * rate, turns.inward)
    # The lean depends on the loads that it changes; each of the two iterations leaves a fifth of the error. Written out, because a
    # loop here would keep `turn_lanes` from its vectors.
    hard = on_slope(upright, ground, turns)
    once = on_slope(upright, leaned(ground, tilt_of(hard, turns.joint, m.wheel, m.geometry)), turns)
    return on_slope(upright, leaned(ground, tilt_of(once, turns.joint, m.wheel, m.geometry)), turns)


@compiled
def on_slope(upright: NormalForces, gravity: Vector, turns: SteadyTurns) -> NormalForces:
    """Loads of a turn with its weight square to the ground, and what this specific force of rest [m/s2] adds to them."""
    return with_more(with_more(upright, gravity.x, turns.ahead), gravity.y, turns.aside)


@compiled
def least_margin(
    floor: float, speed: float, turns: SteadyTurns, ground: Vector, machine: LoadedMachine
) -> float:
    """Smallest margin of a turn that starts at `speed` [m/s, reverse negative], while the machine slows down.

    It slows down by `braking`, uphill by more and downhill by less. No heading is computed after one below `floor`.
    """
    direction = 1.0 if speed >= 0.0 else -1.0
    here, least = ground, 1e9
    for _ in range(headings_of(machine)):
        rate = within_grip(speed * turns.curvature, speed, machine.wheel.lateral_peak)
        least = min(least, margin(steady_forces(speed, rate, turns, here, machine), machine.standing).ratio)
        # a machine that does not turn keeps its heading, and its loads with it
        if least < floor or rate == 0.0:
            return least
        speed = slowed(speed, direction, here, machine)
        here = turned_gravity(here, rate * TURN_STEP)
    return least


@compiled
def headings_of(machine: LoadedMachine) -> int:
    """Headings that are judged in a turn, the present one included."""
    return int(machine.prediction.turn_ahead / TURN_STEP + 0.5) + 1


@compiled
def slowed(speed: float, direction: float, here: Vector, machine: LoadedMachine) -> float:
    """Speed [m/s] at the next heading; direction: +1 forward, -1 reverse; here: specific force of rest at this one [m/s2]."""
    slower = max(machine.prediction.braking + direction * here.x, 0.0) * TURN_STEP
    return direction * max(abs(speed) - slower, 0.0)
