"""Friction that falls with the sliding speed."""

import math

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.effects.ports import carrier_motion
from plant.physics.state import G_FRICTION, KAPPA, TAN_ALPHA
from plant.physics.workspace import Workspace


@uncounted
def before_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """Scale the friction by the speed at which the contact patch slides, from the transient slips."""
    ahead, _, _ = carrier_motion(work, wheel)
    sliding = abs(ahead) * math.sqrt(state[KAPPA + wheel] ** 2 + state[TAN_ALPHA + wheel] ** 2)
    work.ground[wheel, G_FRICTION] /= 1.0 + q[0] * sliding


EFFECT = Effect(
    name="velocity_dependent_friction",
    sentence="The tyres grip less the faster they slide.",
    equation="mu = mu0/(1 + lambda V_s)",
    parameters=(Parameter("decay_s_per_m", "s/m", 0.03, 0.0, 1.0, "lambda: 0.03 loses a quarter at 10 m/s"),),
    acts_on="peak and sliding friction",
    signature="Braking force from speed is smaller than driving force at creep, at the same slip.",
    excited_by="locked wheels from several speeds",
    confusable=(Confusable("surface_friction", "friction of the ground is the same at every sliding speed"),),
    source="Magic Formula 5.2, LMUV",
)
