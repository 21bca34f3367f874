"""The lateral force of the tyres by a curve of its own over the slip angle: whatever law they follow, where none is known."""

from plant.compiled import uncounted
from plant.effects.curves import between_knots
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.effects.ports import push_wheel
from plant.physics.state import T_LATERAL, TAN_ALPHA
from plant.physics.workspace import Workspace

KNOTS = (0.0, 0.03, 0.08, 0.2)  # tangent of the slip angle; a loader's turns reach the last one
SHARE = "share of the lateral force that comes to it at a tangent of the slip angle of"


@uncounted
def after_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """Add a share of the lateral force, which depends on the slip angle."""
    share = between_knots(abs(state[TAN_ALPHA + wheel]), KNOTS, q)
    push_wheel(work, wheel, 0.0, share * work.tyres[wheel, T_LATERAL], 0.0)


EFFECT = Effect(
    name="cornering_curve",
    sentence="The tyres' lateral force follows another curve over the slip angle.",
    equation="F_y -> F_y (1 + c(|tan alpha|)), c linear between 0, 0.03, 0.08 and 0.2",
    parameters=(
        Parameter("at_0", "1", 0.15, -0.9, 2.0, f"{SHARE} 0"),
        Parameter("at_0_03", "1", 0.15, -0.9, 2.0, f"{SHARE} 0.03"),
        Parameter("at_0_08", "1", 0.15, -0.9, 2.0, f"{SHARE} 0.08"),
        Parameter("at_0_2", "1", 0.15, -0.9, 2.0, f"{SHARE} 0.2 and beyond"),
    ),
    acts_on="lateral force, yaw moment",
    signature="Slip angles in turns differ from what the tyres' data say, by another share at each angle.",
    excited_by="turns, gentle and hard",
    confusable=(
        Confusable("surface_friction", "another grip changes the curve only where it bends"),
        Confusable("lateral_relaxation", "a relaxation length shows where a turn begins, not while it lasts"),
        Confusable("inflation_pressure", "another pressure changes the radius too"),
    ),
    source="a broken line, as measured tyre curves are tabulated: Pacejka, Tire and Vehicle Dynamics, 3rd ed., chapter 4",
)
