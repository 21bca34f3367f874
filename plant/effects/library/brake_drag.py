"""Brakes that drag."""

import math

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.physics.state import JOINT_RATE, WHEEL
from plant.physics.workspace import Workspace

TURNING = 0.05  # wheel speed below which the drag fades [rad/s]


@uncounted
def joints(q: Array, x: int, state: Array, p: Array, work: Workspace) -> None:
    """A constant torque against the spin."""
    for wheel in range(4):
        drag = q[0] if wheel < 2 else q[1]
        work.tree.effort[WHEEL + wheel] -= drag * math.tanh(state[JOINT_RATE + WHEEL + wheel] / TURNING)


EFFECT = Effect(
    name="brake_drag",
    sentence="The released brakes drag.",
    equation="T = -T_d sgn(omega)",
    parameters=(
        Parameter("front_N_m", "N m", 500.0, 0.0, 10e3, "T_d of each front wheel: 0.3 to 1 kN m"),
        Parameter("rear_N_m", "N m", 500.0, 0.0, 10e3, "T_d of each rear wheel"),
    ),
    acts_on="longitudinal force, wheel torque",
    signature="Resistance that depends neither on load nor on speed.",
    excited_by="coasting with brakes free, empty and loaded",
    confusable=(Confusable("rolling_resistance", "rolling resistance grows with the load"),),
    source="Coulomb friction",
)
