"""The lugs of the tread shake the machine."""

import math

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.effects.ports import spin
from plant.physics.state import G_HEIGHT, G_RISE, JOINT, WHEEL
from plant.physics.workspace import Workspace


@uncounted
def before_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """The ground rises and falls with the lugs that pass."""
    angle = q[1] * state[JOINT + WHEEL + wheel]
    work.ground[wheel, G_HEIGHT] += q[0] * math.sin(angle)
    work.ground[wheel, G_RISE] += q[0] * math.cos(angle) * q[1] * spin(work, wheel)


EFFECT = Effect(
    name="lug_excitation",
    sentence="The lugs of the tread lift the wheels once per lug.",
    equation="z = a sin(n theta)",
    parameters=(
        Parameter("amplitude_mm", "mm", 1.0, 0.0, 10.0, "a, after the tyre has enveloped the lug", si=1e-3),
        Parameter("lugs", "1", 22.0, 1.0, 60.0, "n on the circumference: 20 to 24", shape=True),
    ),
    acts_on="normal forces, vertical acceleration",
    signature="A tone whose frequency is n times that of the wheel: 10 Hz at 2 m/s.",
    excited_by="constant speed on hard ground",
    confusable=(
        Confusable("vertical_damping", "modes keep their frequency when the speed changes"),
        Confusable("washboard", "waves of the ground follow the distance driven, not the wheel's angle"),
    ),
    source="tread pitch over the circumference",
)
