"""Inertia of the frames in yaw."""

from collections.abc import Mapping

from plant.effects.blocks import body_block
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.physics.parameters import B_FRONT_FRAME, B_REAR_FRAME
from plant.sheets.machine import Machine


def prepare(q: Mapping[str, float], p: Array, machine: Machine) -> None:
    """Scale the inertia about the vertical axis."""
    for start, factor in ((B_FRONT_FRAME, q["front"]), (B_REAR_FRAME, q["rear"])):
        body_block(p, start)[6] *= factor


EFFECT = Effect(
    name="yaw_inertia",
    sentence="The frames resist yaw acceleration more or less than assumed.",
    equation="I_zz -> k I_zz",
    parameters=(
        Parameter("front", "1", 1.4, 0.2, 4.0, "k of the front frame", off=1.0),
        Parameter("rear", "1", 1.4, 0.2, 4.0, "k of the rear frame", off=1.0),
    ),
    acts_on="yaw rate, joint torque, lateral force",
    signature="An error of joint torque and side force proportional to the yaw acceleration.",
    excited_by="zigzag",
    confusable=(Confusable("lateral_relaxation", "a relaxation length fades with speed"),),
    source="Newton-Euler",
)
