"""How strongly the two slips weaken one another."""

from collections.abc import Mapping

from plant.effects.blocks import wheel_blocks
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.physics.parameters import W_RBX1, W_RBY1
from plant.sheets.machine import Machine


def prepare(q: Mapping[str, float], p: Array, machine: Machine) -> None:
    """Steeper or flatter weights of the combined slip."""
    for block in wheel_blocks(p):
        block[W_RBX1] *= q["factor"]
        block[W_RBY1] *= q["factor"]


EFFECT = Effect(
    name="combined_slip",
    sentence="Cornering costs the tyres more or less of their traction than assumed.",
    equation="G(alpha) = cos(C atan(k B tan alpha))",
    parameters=(
        Parameter(
            "factor",
            "1",
            0.0,
            0.0,
            3.0,
            "k: steepness over that of the machine file; 0: the slips do not mix",
            off=1.0,
        ),
    ),
    acts_on="longitudinal and lateral force together",
    signature="At the same slip the longitudinal force is lost in turns, and only there.",
    excited_by="turning under torque",
    confusable=(Confusable("surface_friction", "friction shows when driving straight too"),),
    source="Pacejka, Tire and Vehicle Dynamics, 3rd ed., section 4.3.2",
)
