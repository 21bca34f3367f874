"""The state of a machine that rolls in a steady turn on a plane road, by Newton's method on the plant's own equations.

Wheels turn freely, so there are no longitudinal forces and the speed itself is not held. The lateral forces of the tyres
give the turn its centripetal acceleration and balance the slope; heave, roll, pitch and oscillation rest under these forces.
The balance holds at the start's heading; a turning machine on a slope leaves that heading and with it the balance.
"""

import math

import numpy as np
from numpy.typing import NDArray

from plant.physics import attitude
from plant.physics import state as s
from plant.physics.dynamics import derivative
from plant.physics.equilibrium import NoEquilibriumError, accelerations, solved
from plant.physics.parameters import P_FRICTION
from plant.physics.workspace import Workspace

Array = NDArray[np.float64]

ACROSS, ABOVE, ROLL, PITCH, YAW, OSCILLATION = range(1, 7)
STEADY = np.array((ACROSS, ABOVE, ROLL, PITCH, YAW, OSCILLATION))
"""The balanced accelerations. The unknowns ACROSS and YAW are of the motion: lateral over forward speed of the rear axle, and the yaw rate
over the speed beyond that of rolling without slip [1/m]."""


def roll_steadily(
    state: Array,
    p: Array,
    work: Workspace,
    active: Array | None,
    road: Array,
    heading: float,
    speed: float,
    axles: tuple[float, float],
) -> None:
    """Put `state`, which rests in heave, roll, pitch and oscillation, into steady rolling at `speed` of the rear axle [m/s].

    road: its axes in the world, (3, 3); heading: of the rear frame about the road's normal [rad]; axles: how far the rear axle lies
    behind and the front axle ahead of the joint [m]. Raises NoEquilibriumError where tyres cannot hold the turn or a wheel would lift
    the machine over.
    """
    command = np.zeros(s.COMMANDS)
    resting = state.copy()
    delta, (behind, ahead) = state[s.JOINT + s.FRONT_FRAME], axles
    curvature = math.sin(delta) / (
        ahead + behind * math.cos(delta)
    )  # of the rear axle's path without slip [1/m]

    def residual(change: Array) -> Array:
        state[:] = resting
        _lean(state, change, road, heading)
        derivative(state, command, p, 0.0, work, active)
        _set_motion(state, work, road, speed, change[ACROSS], speed * (curvature + change[YAW]), behind)
        derivative(state, command, p, 0.0, work, active)
        _set_wheels(state, work)
        derivative(state, command, p, 0.0, work, active)
        return accelerations(work, road, p)

    if not solved(residual, np.zeros(7), STEADY):
        raise NoEquilibriumError(
            f"the machine cannot roll steadily at {speed:.2f} m/s with {math.degrees(delta):.1f} deg of articulation: it would tip over or "
            f"slide (road slope {math.degrees(math.acos(road[2, 2])):.1f} deg, friction scale {p[P_FRICTION]:.2f})"
        )


def _lean(state: Array, change: Array, road: Array, heading: float) -> None:
    """Move the resting machine by heave [m], roll, pitch and oscillation [rad]."""
    if not change.any():
        return  # to the bit as it rests
    state[s.POSITION : s.POSITION + 3] += change[ABOVE] * road[:, 2]
    roll, pitch = change[ROLL], change[PITCH]
    forward = math.cos(heading) * road[:, 0] + math.sin(heading) * road[:, 1]
    left = -math.sin(heading) * road[:, 0] + math.cos(heading) * road[:, 1]
    turn = attitude.of_turn(roll * forward + pitch * left)
    w, x, y, z = state[s.ATTITUDE : s.ATTITUDE + 4].tolist()
    state[s.ATTITUDE : s.ATTITUDE + 4] = attitude.product(turn, attitude.unit(w, x, y, z))
    state[s.JOINT + s.REAR_AXLE] += change[OSCILLATION]


def _set_motion(
    state: Array, work: Workspace, road: Array, speed: float, sideways: float, yaw_rate: float, behind: float
) -> None:
    """Velocities of the joint and of the turn; sideways: lateral over forward speed of the rear axle."""
    world = work.places.world
    normal = world.T @ road[:, 2]
    forward = np.array((1.0, 0.0, 0.0)) - normal[0] * normal
    forward /= np.linalg.norm(forward)
    left = np.cross(normal, forward)
    state[s.ANGULAR : s.ANGULAR + 3] = yaw_rate * normal
    state[s.VELOCITY : s.VELOCITY + 3] = world @ (
        speed * forward + (speed * sideways + yaw_rate * behind) * left
    )
    state[s.STICK : s.STICK + 4] = 1.0


def _set_wheels(state: Array, work: Workspace) -> None:
    """Wheels that roll without longitudinal slip, tyres with the side slip of the steady motion."""
    for wheel in range(4):
        sliding, radius, side_slip = work.tyres[wheel, [s.T_SLIDING_X, s.T_ROLLING_RADIUS, s.T_SIDE_SLIP]]
        state[s.JOINT_RATE + s.WHEEL + wheel] = sliding / radius
        state[s.STICK + wheel] = math.copysign(1.0, sliding)
        state[s.TAN_ALPHA + wheel] = -side_slip
