"""Play of the steering."""

import math
from collections.abc import Mapping

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter, degrees
from plant.effects.ports import steering_cylinders
from plant.physics.state import FRONT_FRAME, JOINT
from plant.physics.workspace import Workspace


@uncounted
def joints(q: Array, x: int, state: Array, p: Array, work: Workspace) -> None:
    """Stiff contact beyond the play; within it the frames swing freely."""
    ahead, faster = steering_cylinders(state, p, work, x)
    pressed = max(abs(ahead) - q[0], 0.0)
    if pressed > 0.0:
        pushing = q[1] * pressed + q[2] * math.copysign(1.0, ahead) * faster
        work.tree.effort[FRONT_FRAME] += math.copysign(max(pushing, 0.0), ahead)


def start(q: Mapping[str, float], x: int, state: Array, p: Array, work: Workspace) -> None:
    """At rest in the middle of the play."""
    state[x], state[x + 1] = state[JOINT + FRONT_FRAME], 0.0


EFFECT = Effect(
    name="steering_play",
    sentence="Worn pins leave the frames free to swing by a little.",
    equation="T = k (e - D sgn(e)) for |e| > D, else 0, e = delta_c - delta",
    parameters=(
        degrees("play_deg", 0.3, 0.0, 3.0, "D to either side: 0.2 to 0.5"),
        Parameter("stiffness_N_m_per_rad", "N m/rad", 4.4e6, 1e5, 1e8, "k in contact", shape=True),
        Parameter("damping_N_m_s_per_rad", "N m s/rad", 26e3, 0.0, 1e6, "in contact", shape=True),
    ),
    acts_on="articulation angle, yaw rate",
    signature="A dead band: small steering motions do not arrive.",
    excited_by="small zigzag",
    confusable=(Confusable("steering_compliance", "compliance does not depend on the amplitude"),),
    source="dead zone with contact stiffness",
    own_states=2,
)
