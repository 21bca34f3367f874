"""A ditch or bump across the path of the machine."""

import math

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.effects.ports import along_ground, raise_ground
from plant.physics.workspace import Workspace


@uncounted
def before_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """One whole cosine down and up again."""
    ahead = along_ground(state, work, wheel)
    depth = q[2] if wheel % 2 == 0 else q[3]
    part = (ahead - q[0]) / q[1]
    if 0.0 < part < 1.0:
        drop = -0.5 * depth * (1.0 - math.cos(2.0 * math.pi * part))
        raise_ground(state, work, wheel, drop, -depth * math.pi / q[1] * math.sin(2.0 * math.pi * part))


EFFECT = Effect(
    name="ditch",
    sentence="There is a ditch or a bump across the path of the machine.",
    equation="z = -d (1 - cos(2 pi s/l))/2",
    parameters=(
        Parameter(
            "distance_m", "m", 10.0, -1e3, 1e3, "where it begins, along the world's x axis", shape=True
        ),
        Parameter("length_m", "m", 3.0, 0.1, 50.0, "l across", shape=True),
        Parameter("left_m", "m", 0.2, -1.0, 1.0, "d under the left wheels; negative: a bump"),
        Parameter("right_m", "m", 0.2, -1.0, 1.0, "d under the right wheels"),
    ),
    acts_on="normal forces, longitudinal force, pitch, roll",
    signature="Loads fall and rise once per axle.",
    excited_by="driving over it",
    confusable=(
        Confusable("vertical_damping", "damping changes what rings after the obstacle, not the obstacle"),
    ),
    source="geometry",
)
