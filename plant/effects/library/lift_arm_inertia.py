"""Inertia and centre of the lift arm."""

from collections.abc import Mapping

from plant.effects.blocks import body_block
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.physics.parameters import B_LIFT_ARM
from plant.sheets.machine import Machine


def prepare(q: Mapping[str, float], p: Array, machine: Machine) -> None:
    """Mass further out along the arm, which resists pitch and yaw alike, and a higher centre of gravity."""
    arm = body_block(p, B_LIFT_ARM)
    arm[5] += q["inertia_kg_m2"]
    arm[6] += q["inertia_kg_m2"]
    arm[3] += q["higher_mm"]


EFFECT = Effect(
    name="lift_arm_inertia",
    sentence="The lift arm resists its acceleration more than assumed.",
    equation="p_l A r(phi) = ... + dI d2phi/dt2 + m_a e a_x",
    parameters=(
        Parameter(
            "inertia_kg_m2",
            "kg m2",
            2000.0,
            0.0,
            20e3,
            "dI about its centre: arms with linkage 6e3 to 20e3 about the pivot",
        ),
        Parameter("higher_mm", "mm", 100.0, -500.0, 1000.0, "e: centre of the arm above its line", si=1e-3),
    ),
    acts_on="lift pressure",
    signature="Transients of the lift pressure in proportion to the arm's angular acceleration and to a_x.",
    excited_by="lifting while driving",
    confusable=(Confusable("payload_mass", "a payload offsets the pressure at rest"),),
    source="Newton-Euler about the arm's pivot",
)
