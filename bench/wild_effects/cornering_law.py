"""A law of the loader's wild arms: tyres whose lateral force rises in another curve than the Magic Formula."""

import math

from plant.compiled import uncounted
from plant.effects.effect import Array, Effect, Parameter
from plant.effects.ports import push_wheel
from plant.physics.state import T_LATERAL, TAN_ALPHA
from plant.physics.workspace import Workspace


@uncounted
def after_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """A tyre that is stiffer at small slip angles, and weaker at large ones."""
    slip = state[TAN_ALPHA + wheel] / q[1]
    share = q[0] * (2.0 * math.exp(-slip * slip) - 1.0)
    push_wheel(work, wheel, 0.0, share * work.tyres[wheel, T_LATERAL], 0.0)


EFFECT = Effect(
    name="cornering_law",
    sentence="The tyres' lateral force follows another curve.",
    equation="F_y -> F_y (1 + s (2 exp(-(tan(alpha)/a)^2) - 1))",
    parameters=(
        Parameter("share", "1", 0.15, -0.5, 0.5, "s"),
        Parameter("slip", "1", 0.05, 0.005, 1.0, "a", shape=True),
    ),
    acts_on="lateral force",
    signature="Slip angles in turns differ from what the tyre's data say, by another share at each angle.",
    excited_by="turns",
    source="measured curves differ from a Magic Formula's fit in shape",
)
