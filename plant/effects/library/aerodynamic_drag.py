"""Drag of the air."""

import math

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.effects.ports import push
from plant.physics.state import REAR_FRAME
from plant.physics.workspace import Workspace


@uncounted
def bodies(q: Array, x: int, state: Array, p: Array, work: Workspace) -> None:
    """Force against the velocity of the rear frame, at a height above its joint."""
    motion = work.tree.motion[REAR_FRAME]
    speed = math.sqrt(motion[3] ** 2 + motion[4] ** 2 + motion[5] ** 2)
    factor = -0.5 * q[1] * q[0] * speed
    push(work, REAR_FRAME, 0.0, 0.0, q[2], factor * motion[3], factor * motion[4], factor * motion[5])


EFFECT = Effect(
    name="aerodynamic_drag",
    sentence="The air resists the motion with the square of the speed.",
    equation="F = -1/2 rho c_d A |V| V",
    parameters=(
        Parameter(
            name="drag_area_m2",
            unit="m2",
            typical=5.5,
            low=0.0,
            high=20.0,
            meaning="c_d A: drag coefficient times frontal area",
        ),
        Parameter(
            name="air_density_kg_per_m3",
            unit="kg/m3",
            typical=1.2,
            low=0.5,
            high=1.6,
            meaning="rho",
            shape=True,
        ),
        Parameter(
            name="height_m",
            unit="m",
            typical=0.9,
            low=-1.0,
            high=4.0,
            meaning="of its centre above the joint",
            shape=True,
        ),
    ),
    acts_on="longitudinal force, speed",
    signature="Resistance that grows with the square of the speed: 0.3 kN at 35 km/h.",
    excited_by="coasting down from top speed",
    confusable=(
        Confusable(name="rolling_resistance", separate="rolling resistance hardly depends on speed"),
    ),
    source="Hucho, Aerodynamik des Automobils",
)
