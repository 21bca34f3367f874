"""Friction of the oscillating rear axle's pivot."""

import math

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.physics.state import JOINT_RATE, REAR_AXLE
from plant.physics.workspace import Workspace

TURNING = 0.005  # rate over which the friction turns its direction [rad/s]


@uncounted
def joints(q: Array, x: int, state: Array, p: Array, work: Workspace) -> None:
    """Coulomb friction against the oscillation."""
    work.tree.effort[REAR_AXLE] -= q[0] * math.tanh(state[JOINT_RATE + REAR_AXLE] / TURNING)


EFFECT = Effect(
    name="pivot_friction",
    sentence="The rear axle's pivot resists turning, so that the rear axle takes part of the roll moment.",
    equation="M_p = -M_c tanh(rate/0.005 rad/s)",
    parameters=(
        Parameter(
            name="torque_N_m",
            unit="N m",
            typical=700.0,
            low=0.0,
            high=20e3,
            meaning="M_c: friction coefficient 0.12 times 57 kN on a pin of 0.1 m radius",
        ),
    ),
    acts_on="difference of the rear wheels' normal forces",
    signature="Hysteresis of the rear wheels' load difference over the oscillation angle.",
    excited_by="slow twist: one wheel after the other over a step",
    confusable=(
        Confusable(name="oscillation_stops", separate="stops act beyond a threshold angle only"),
        Confusable(name="frame_torsion", separate="torsion has no loop where the twist rate is zero"),
    ),
    source="Coulomb's law at the pivot pin",
)
