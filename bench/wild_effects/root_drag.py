"""A law of the loader's wild arms: resistance with a power of speed between dry friction and drag."""

import math

from plant.compiled import uncounted
from plant.effects.effect import Array, Effect, Parameter
from plant.effects.ports import push
from plant.physics.state import REAR_FRAME
from plant.physics.workspace import Workspace

SLOW = 0.05  # speed below which the force fades [m/s]


@uncounted
def bodies(q: Array, x: int, state: Array, p: Array, work: Workspace) -> None:
    """Force on the rear frame along it, against its speed."""
    ahead = work.tree.motion[REAR_FRAME][3]
    force = -q[0] * abs(ahead) ** q[1] * math.tanh(ahead / SLOW)
    push(work, REAR_FRAME, 0.0, 0.0, 0.0, force, 0.0, 0.0)


EFFECT = Effect(
    name="root_drag",
    sentence="Something resists with a power of speed below one.",
    equation="F = -c |V|^n sgn(V)",
    parameters=(
        Parameter("force_N", "N", 800.0, 0.0, 2e4, "c: at 1 m/s"),
        Parameter("power", "1", 0.5, 0.1, 3.0, "n", shape=True),
    ),
    acts_on="longitudinal force, speed",
    signature="Resistance that grows less than the speed.",
    excited_by="driving at several speeds",
    source="a power law",
)
