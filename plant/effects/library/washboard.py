"""Regular waves of the ground."""

import math

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.effects.ports import along_ground, raise_ground
from plant.physics.workspace import Workspace


@uncounted
def before_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """A sine along the distance driven."""
    ahead = along_ground(state, work, wheel)
    number = 2.0 * math.pi / q[1]
    raise_ground(
        state, work, wheel, q[0] * math.sin(number * ahead), q[0] * number * math.cos(number * ahead)
    )


EFFECT = Effect(
    name="washboard",
    sentence="The ground has regular waves.",
    equation="z = a sin(2 pi x/L)",
    parameters=(
        Parameter("amplitude_mm", "mm", 15.0, 0.0, 200.0, "a", si=1e-3),
        Parameter("wavelength_m", "m", 2.0, 0.3, 100.0, "L", shape=True),
    ),
    acts_on="normal forces, longitudinal force, pitch, roll",
    signature="A tone whose frequency is the speed over the wavelength.",
    excited_by="driving over it",
    confusable=(Confusable("lug_excitation", "lugs follow the wheel's angle, waves the distance driven"),),
    source="geometry",
)
