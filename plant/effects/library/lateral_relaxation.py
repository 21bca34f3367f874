"""Lateral relaxation length of the tyres."""

from collections.abc import Mapping

from plant.effects.blocks import wheel_blocks
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.physics.parameters import W_LATERAL_STIFFNESS
from plant.sheets.machine import Machine


def prepare(q: Mapping[str, float], p: Array, machine: Machine) -> None:
    """A softer carcass needs a longer distance to build up its force."""
    for block in wheel_blocks(p):
        block[W_LATERAL_STIFFNESS] /= q["factor"]


EFFECT = Effect(
    name="lateral_relaxation",
    sentence="The tyres need a longer or shorter distance to build up their lateral force.",
    equation="sigma dF/ds + F = F_steady, sigma = k C_F/c",
    parameters=(
        Parameter(
            "factor", "1", 2.0, 0.2, 5.0, "k: relaxation length over that of the machine file", off=1.0
        ),
    ),
    acts_on="lateral force, yaw rate",
    signature="The force lags by a distance, not by a time: the lag falls with speed.",
    excited_by="steering steps and zigzag at several speeds",
    confusable=(
        Confusable(
            "steering_compliance",
            "vary the speed three to one: a lag in time stays, a lag in distance becomes shorter",
        ),
    ),
    source="Pacejka, Tire and Vehicle Dynamics, 3rd ed., chapter 7",
)
