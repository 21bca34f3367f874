"""Another pressure in the tyres."""

from collections.abc import Mapping

from plant.effects.blocks import wheel_blocks
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.physics.parameters import change_pressure
from plant.sheets.machine import Machine


def prepare(q: Mapping[str, float], p: Array, machine: Machine) -> None:
    """Pressure changes the radial and carcass stiffness and the terms of the Magic Formula."""
    for wheel, block in enumerate(wheel_blocks(p)):
        change_pressure(block, machine.tyre, q["front_bar"] if wheel < 2 else q["rear_bar"])


EFFECT = Effect(
    name="inflation_pressure",
    sentence="The tyres are warmer, colder or leaking: their pressure is not the assumed one.",
    equation="k_z -> k_z (1 + p_Fz1 dp); K_x, mu_x by the p_Px terms, K_y, mu_y by the p_Py terms",
    parameters=(
        Parameter("front_bar", "bar", 0.4, -2.0, 3.0, "change of the front tyres' pressure"),
        Parameter("rear_bar", "bar", 0.4, -2.0, 3.0, "change of the rear tyres' pressure"),
    ),
    acts_on="vertical stiffness, slip stiffness, rolling radius",
    signature="Rolling radius and bounce frequency move together.",
    excited_by="warm-up",
    confusable=(Confusable("tyre_wear", "wear is irreversible and leaves the bounce frequency"),),
    source="MF-Tyre 6.1 pressure terms",
)
