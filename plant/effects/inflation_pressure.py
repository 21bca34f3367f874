"""Another pressure in the tyres."""

from collections.abc import Mapping

from plant.effects.blocks import wheel_blocks
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.machine import Machine
from plant.parameters import W_PRESSURE, W_QFZ1, W_QFZ2


def prepare(q: Mapping[str, float], p: Array, machine: Machine) -> None:
    """Pressure changes the vertical stiffness and the terms of the Magic Formula."""
    tyre = machine.tyre
    for wheel, block in enumerate(wheel_blocks(p)):
        before = 1.0 + tyre.pfz1 * block[W_PRESSURE]
        block[W_PRESSURE] += (q["front_bar"] if wheel < 2 else q["rear_bar"]) / tyre.nominal_pressure
        after = 1.0 + tyre.pfz1 * block[W_PRESSURE]
        block[W_QFZ1] *= after / before
        block[W_QFZ2] *= after / before


EFFECT = Effect(
    name="inflation_pressure",
    sentence="The tyres are warmer, colder or leaking: their pressure is not the assumed one.",
    equation="k_z -> k_z (1 + p_Fz1 dp); K_x, mu_x by the p_Px terms",
    parameters=(
        Parameter("front_bar", "bar", 0.4, -2.0, 3.0, "change of the front tyres' pressure"),
        Parameter("rear_bar", "bar", 0.4, -2.0, 3.0, "change of the rear tyres' pressure"),
    ),
    acts_on="vertical stiffness, slip stiffness, rolling radius",
    signature="Rolling radius and bounce frequency move together.",
    excited_by="warm-up",
    confusable=(Confusable("tyre_wear", "wear is irreversible and leaves the bounce frequency"),),
    source="MF-Tyre 6.1 pressure terms",
    prepare=prepare,
)
