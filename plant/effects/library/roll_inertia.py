"""Inertia of the frames in roll."""

from collections.abc import Mapping

from plant.effects.blocks import body_block
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.physics.parameters import B_FRONT_FRAME, B_REAR_FRAME
from plant.sheets.machine import Machine


def prepare(q: Mapping[str, float], p: Array, machine: Machine) -> None:
    """Scale the inertia about the longitudinal axis."""
    for start, factor in ((B_FRONT_FRAME, q["front"]), (B_REAR_FRAME, q["rear"])):
        body_block(p, start)[4] *= factor


EFFECT = Effect(
    name="roll_inertia",
    sentence="The frames resist roll acceleration more or less than assumed.",
    equation="I_xx -> k I_xx",
    parameters=(
        Parameter("front", "1", 1.4, 0.2, 4.0, "k of the front frame", off=1.0),
        Parameter("rear", "1", 1.4, 0.2, 4.0, "k of the rear frame", off=1.0),
    ),
    acts_on="normal forces left to right, roll rate",
    signature="Overshoot and slower ringing of the load transfer at 1 to 2 Hz.",
    excited_by="steering steps",
    confusable=(Confusable("payload_slosh", "slosh keeps its own frequency whatever the machine does"),),
    source="Newton-Euler",
)
