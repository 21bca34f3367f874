"""Torque at the wheel other than reported."""

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.physics.state import DRIVE, STICK, WHEEL
from plant.physics.workspace import Workspace


@uncounted
def joints(q: Array, x: int, state: Array, p: Array, work: Workspace) -> None:
    """More or less than the motor reports arrives at the wheel."""
    for wheel in range(4):
        if state[STICK + wheel] != 0.0:
            gain = q[0] if wheel < 2 else q[1]
            work.tree.effort[WHEEL + wheel] += gain * state[DRIVE + wheel]


EFFECT = Effect(
    name="torque_error",
    sentence="The motors deliver other torques than they report: gear losses, warm magnets.",
    equation="T_wheel = (1 + e) T_reported",
    parameters=(
        Parameter("front_percent", "%", -5.0, -50.0, 50.0, "e of the front motors", si=0.01),
        Parameter("rear_percent", "%", -5.0, -50.0, 50.0, "e of the rear motors", si=0.01),
    ),
    acts_on="longitudinal force",
    signature="Acceleration and slip wrong in proportion to the torque.",
    excited_by="traction and regeneration",
    confusable=(
        Confusable(
            "torque_scale",
            "cannot be separated by the reported torque alone; the motor's current separates them",
        ),
        Confusable("mass_split", "mass errors show when coasting on a slope"),
    ),
    source="gear efficiency, magnet temperature",
)
