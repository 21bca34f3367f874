"""A payload that moves in the bucket."""

import math

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.effects.ports import push, twist
from plant.physics.parameters import P_GRAVITY
from plant.physics.state import BUCKET, T_WRENCH
from plant.physics.workspace import Workspace


@uncounted
def bodies(q: Array, x: int, state: Array, p: Array, work: Workspace) -> None:
    """Reaction of the moving part, and its weight where it has moved to.

    The payload is accelerated sideways with the whole machine, whose acceleration follows from the tyres' forces.
    """
    side = work.places.axes[4, :, 1]
    felt = 0.0
    for wheel in range(4):
        for i in range(3):
            felt += side[i] * work.tyres[wheel, T_WRENCH + 3 + i] / work.whole[0]
    omega = 2.0 * math.pi * q[1]
    away, speed = state[x], state[x + 1]
    pull = omega * omega * away + 2.0 * q[2] * omega * speed
    work.rate[x] = speed
    work.rate[x + 1] = -pull - felt
    force, pin = q[0] * (pull + felt), work.places.points[3]
    push(work, BUCKET, pin[0], pin[1], pin[2], force * side[0], force * side[1], force * side[2])
    up = work.places.world[2]
    weight = -q[0] * p[P_GRAVITY] * away
    twist(
        work,
        BUCKET,
        weight * (side[1] * up[2] - side[2] * up[1]),
        weight * (side[2] * up[0] - side[0] * up[2]),
        weight * (side[0] * up[1] - side[1] * up[0]),
    )


EFFECT = Effect(
    name="payload_slosh",
    sentence="Part of the payload swings from side to side.",
    equation="d2y/dt2 + 2 zeta omega dy/dt + omega^2 y = -a_y, M_x = -m_s g y",
    parameters=(
        Parameter("mass_kg", "kg", 250.0, 0.0, 1500.0, "m_s: 5 to 10 per cent of the payload"),
        Parameter("frequency_hz", "Hz", 0.8, 0.2, 5.0, "omega/2 pi: 0.5 to 1.5", shape=True),
        Parameter("damping", "1", 0.05, 0.0, 2.0, "zeta", shape=True),
    ),
    acts_on="front normal forces left to right, roll",
    signature="Load transfer rings at a low frequency of its own after a turn.",
    excited_by="hard turn, then straight ahead",
    confusable=(Confusable("roll_inertia", "the machine's own roll mode follows its mass"),),
    source="equivalent mechanical slosh model, Ibrahim, Liquid Sloshing Dynamics",
    own_states=2,
)
