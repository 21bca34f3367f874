"""Smaller tyres than assumed."""

from collections.abc import Mapping

from plant.effects.blocks import wheel_blocks
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.physics.parameters import W_RADIUS
from plant.sheets.machine import Machine


def prepare(q: Mapping[str, float], p: Array, machine: Machine) -> None:
    """Take the worn rubber off the radius."""
    for wheel, block in enumerate(wheel_blocks(p)):
        block[W_RADIUS] -= q["front_mm"] if wheel < 2 else q["rear_mm"]


EFFECT = Effect(
    name="tyre_wear",
    sentence="The tyres are worn, so that they turn faster at the same speed.",
    equation="R0 -> R0 - d",
    parameters=(
        Parameter("front_mm", "mm", 20.0, -30.0, 60.0, "d of the front tyres", si=1e-3),
        Parameter("rear_mm", "mm", 20.0, -30.0, 60.0, "d of the rear tyres", si=1e-3),
    ),
    acts_on="wheel speed, slip",
    signature="Apparent slip at zero torque, the same at every speed and load.",
    excited_by="coasting straight ahead",
    confusable=(
        Confusable("wheel_speed_scale", "a scale error of the sensor leaves the torque per force as it is"),
        Confusable("inflation_pressure", "pressure changes the vertical stiffness too"),
    ),
    source="effective rolling radius",
)
