"""Compliance of the steering cylinders."""

from collections.abc import Mapping

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.effects.ports import steering_cylinders
from plant.physics.state import FRONT_FRAME, JOINT
from plant.physics.workspace import Workspace


@uncounted
def joints(q: Array, x: int, state: Array, p: Array, work: Workspace) -> None:
    """The cylinders move as demanded; oil and hoses between them and the frames are a spring."""
    ahead, faster = steering_cylinders(state, p, work, x)
    work.tree.effort[FRONT_FRAME] += q[0] * ahead + q[1] * faster


def start(q: Mapping[str, float], x: int, state: Array, p: Array, work: Workspace) -> None:
    """At rest the spring bears no load."""
    state[x], state[x + 1] = state[JOINT + FRONT_FRAME], 0.0


EFFECT = Effect(
    name="steering_compliance",
    sentence="The steering is elastic: oil, hoses and pins are a spring between cylinder and frame.",
    equation="J d2delta/dt2 + c (ddelta/dt - ddelta_c/dt) + k (delta - delta_c) = T",
    parameters=(
        Parameter(
            "stiffness_N_m_per_rad",
            "N m/rad",
            4.4e6,
            1e5,
            1e8,
            "k = 2 beta (A1^2/V1 + A2^2/V2) r^2",
            shape=True,
        ),
        Parameter("damping_N_m_s_per_rad", "N m s/rad", 26e3, 0.0, 1e6, "c", shape=True),
    ),
    acts_on="articulation angle, yaw rate, steering pressure",
    signature="The articulation angle moves at constant demand and rings at about 5 Hz; pressures oscillate with it.",
    excited_by="steering pulses, snaking",
    confusable=(
        Confusable("lateral_relaxation", "a relaxation length fades with speed"),
        Confusable("steering_play", "play shows as a dead band at small amplitude"),
    ),
    source="bulk modulus of the oil in both chambers",
    own_states=2,
)
