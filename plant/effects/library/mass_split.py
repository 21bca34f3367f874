"""How the mass is shared by the two frames."""

from collections.abc import Mapping

from plant.effects.blocks import body_block
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.physics.parameters import B_FRONT_FRAME, B_REAR_FRAME
from plant.sheets.machine import Machine


def prepare(q: Mapping[str, float], p: Array, machine: Machine) -> None:
    """Mass from the rear frame to the front frame, and another height of the rear frame's centre."""
    rear, front = body_block(p, B_REAR_FRAME), body_block(p, B_FRONT_FRAME)
    rear[0] -= q["forward_kg"]
    front[0] += q["forward_kg"]
    rear[3] += q["higher_mm"]


EFFECT = Effect(
    name="mass_split",
    sentence="The frames share the mass otherwise than assumed, or the centre of gravity is higher.",
    equation="m_f -> m_f + d, m_r -> m_r - d, h_r -> h_r + e",
    parameters=(
        Parameter("forward_kg", "kg", 400.0, -1500.0, 1500.0, "d"),
        Parameter("higher_mm", "mm", 0.0, -500.0, 500.0, "e", si=1e-3),
    ),
    acts_on="normal forces",
    signature="Standing loads wrong by a constant; load transfer wrong in proportion to the acceleration.",
    excited_by="standstill, then acceleration",
    confusable=(Confusable("payload_mass", "a payload shows in the lift pressure"),),
    source="statics",
)
