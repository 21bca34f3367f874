"""Friction of the articulation joint."""

import math

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.physics.state import FRONT_FRAME, JOINT_RATE
from plant.physics.workspace import Workspace

TURNING = 0.005  # rate over which the friction turns its direction [rad/s]


@uncounted
def joints(q: Array, x: int, state: Array, p: Array, work: Workspace) -> None:
    """A free joint is slowed down."""
    if work.tree.driven[FRONT_FRAME] == 0.0:
        work.tree.effort[FRONT_FRAME] -= q[0] * math.tanh(state[JOINT_RATE + FRONT_FRAME] / TURNING)


@uncounted
def states(q: Array, x: int, state: Array, p: Array, work: Workspace) -> None:
    """Cylinders that move the joint as demanded must give more."""
    if work.tree.driven[FRONT_FRAME] > 0.0:
        work.tree.effort[FRONT_FRAME] += q[0] * math.tanh(state[JOINT_RATE + FRONT_FRAME] / TURNING)


EFFECT = Effect(
    name="steering_friction",
    sentence="The pins of the articulation joint rub.",
    equation="T_f = T_c sgn(ddelta/dt)",
    parameters=(Parameter("torque_N_m", "N m", 2000.0, 0.0, 20e3, "T_c: 1 to 3 kN m"),),
    acts_on="steering joint torque, steering pressure",
    signature="An offset of the joint torque that changes sign with the direction of steering.",
    excited_by="slow steering to both sides",
    confusable=(Confusable("turn_slip", "turn slip fades with speed"),),
    source="Coulomb friction",
)
