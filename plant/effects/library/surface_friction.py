"""Another friction of the ground, the same or different on the two sides."""

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.physics.state import G_FRICTION
from plant.physics.workspace import Workspace


@uncounted
def before_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """Scale the friction under this wheel."""
    work.ground[wheel, G_FRICTION] *= q[0] if wheel % 2 == 0 else q[1]


EFFECT = Effect(
    name="surface_friction",
    sentence="The ground gives more or less grip than assumed, perhaps on one side only.",
    equation="D_i = k_i D",
    parameters=(
        Parameter("left", "1", 0.5, 0.05, 2.0, "k under the left wheels, over the friction assumed", off=1.0),
        Parameter("right", "1", 0.5, 0.05, 2.0, "k under the right wheels", off=1.0),
    ),
    acts_on="slip, longitudinal and lateral force, yaw moment",
    signature="Slip jumps at equal torque where the demand nears the peak; a yaw moment if the sides differ.",
    excited_by="hard traction or braking",
    confusable=(
        Confusable(
            "velocity_dependent_friction",
            "friction that falls with sliding speed leaves the slope at small slip as it is",
        ),
        Confusable("torque_scale", "a wrong torque shows at small slip too"),
    ),
    source="Coulomb's law",
)
