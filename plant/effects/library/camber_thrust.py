"""Lateral force of a leaning tyre."""

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.effects.ports import lean, push_wheel
from plant.physics.state import T_NORMAL
from plant.physics.workspace import Workspace


@uncounted
def after_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """Force to the side to which the wheel leans."""
    push_wheel(work, wheel, 0.0, q[0] * work.tyres[wheel, T_NORMAL] * lean(work, wheel), 0.0)


EFFECT = Effect(
    name="camber_thrust",
    sentence="A leaning wheel pushes to the side to which it leans.",
    equation="F_y = C_gamma N sin(gamma)",
    parameters=(Parameter("coefficient", "1/rad", 0.45, 0.0, 2.0, "C_gamma: 0.3 to 0.6"),),
    acts_on="lateral force",
    signature="Lateral force without slip angle while the frame rolls or an axle oscillates.",
    excited_by="one side over a kerb, straight ahead",
    confusable=(
        Confusable(
            "grade", "the force of a bank is the whole machine's weight component, not that of one axle"
        ),
    ),
    source="Pacejka, Tire and Vehicle Dynamics, 3rd ed., section 4.2",
)
