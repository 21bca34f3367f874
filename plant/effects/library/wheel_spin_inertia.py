"""Inertia of what turns with a wheel."""

from collections.abc import Mapping

from plant.effects.blocks import wheel_blocks
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.physics.parameters import W_SPIN
from plant.sheets.machine import Machine


def prepare(q: Mapping[str, float], p: Array, machine: Machine) -> None:
    """Add the rotor's inertia, seen at the wheel."""
    for block in wheel_blocks(p):
        block[W_SPIN] += q["extra_kg_m2"]


EFFECT = Effect(
    name="wheel_spin_inertia",
    sentence="Motors and gears that turn with the wheels take part of the torque.",
    equation="T = F r + (J_w + dJ) domega/dt",
    parameters=(Parameter("extra_kg_m2", "kg m2", 60.0, -80.0, 500.0, "dJ of each wheel"),),
    acts_on="longitudinal force, pitch",
    signature="Less acceleration per torque; load transfer in proportion to the wheels' angular acceleration.",
    excited_by="torque steps, wheel spin",
    confusable=(
        Confusable("mass_split", "wheel spin without acceleration distinguishes them"),
        Confusable("torque_error", "a wrong torque shows at constant speed as well"),
    ),
    source="Newton-Euler about the axle",
)
