"""Gyroscopic moment of the wheels."""

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.effects.ports import spin, twist
from plant.physics.parameters import P_WHEELS, W_SPIN, WHEEL_SIZE
from plant.physics.state import WHEEL
from plant.physics.workspace import Workspace


@uncounted
def bodies(q: Array, x: int, state: Array, p: Array, work: Workspace) -> None:
    """A share of the moment that turning a spinning wheel takes; -1 takes away what the bodies have."""
    for wheel in range(4):
        m, a = work.tree.motion[WHEEL + wheel], work.places.axles[wheel]
        momentum = -q[0] * p[P_WHEELS + wheel * WHEEL_SIZE + W_SPIN] * spin(work, wheel)
        twist(
            work,
            WHEEL + wheel,
            momentum * (m[1] * a[2] - m[2] * a[1]),
            momentum * (m[2] * a[0] - m[0] * a[2]),
            momentum * (m[0] * a[1] - m[1] * a[0]),
        )


EFFECT = Effect(
    name="wheel_gyroscopics",
    sentence="Turning the spinning wheels takes a roll moment: more with heavy rotors, none in a model without spin.",
    equation="M = -s omega x (J Omega e)",
    parameters=(
        Parameter("share", "1", -1.0, -1.0, 5.0, "s over what tyre and rim have already; -1: none at all"),
    ),
    acts_on="normal forces left to right",
    signature="Load transfer in proportion to yaw rate times wheel speed.",
    excited_by="fast turns",
    confusable=(
        Confusable(
            "mass_split", "in steady turns the same as a higher centre of gravity: not distinguishable"
        ),
    ),
    source="Euler's equations of a spinning wheel",
)
