"""A step under one or both sides."""

import math

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.effects.ports import along_ground, raise_ground
from plant.physics.workspace import Workspace


@uncounted
def before_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """A ramp of a half cosine up to the step's height."""
    ahead = along_ground(state, work, wheel)
    height = q[2] if wheel % 2 == 0 else q[3]
    part = (ahead - q[0]) / q[1]
    if part >= 1.0:
        raise_ground(state, work, wheel, height, 0.0)
    elif part > 0.0:
        rise = 0.5 * height * (1.0 - math.cos(math.pi * part))
        raise_ground(state, work, wheel, rise, 0.5 * height * math.pi / q[1] * math.sin(math.pi * part))


EFFECT = Effect(
    name="kerb",
    sentence="The ground steps up or down at one place.",
    equation="z = h (1 - cos(pi s/l))/2",
    parameters=(
        Parameter(
            "distance_m", "m", 10.0, -1e3, 1e3, "where it begins, along the world's x axis", shape=True
        ),
        Parameter("length_m", "m", 0.4, 0.05, 50.0, "l: as the tyre envelops it", shape=True),
        Parameter("left_m", "m", 0.1, -0.5, 0.5, "h under the left wheels"),
        Parameter("right_m", "m", 0.1, -0.5, 0.5, "h under the right wheels"),
    ),
    acts_on="normal forces, longitudinal force, pitch, roll",
    signature="First the front, then the rear wheels jump; the distance between is the wheelbase.",
    excited_by="driving over it",
    confusable=(
        Confusable("vertical_damping", "damping changes what rings after the obstacle, not the obstacle"),
    ),
    source="geometry; enveloped as a half cosine",
)
