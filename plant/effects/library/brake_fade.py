"""Brakes that fade when hot."""

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.physics.state import BRAKE, JOINT_RATE, STICK, WHEEL
from plant.physics.workspace import Workspace

MOST = 0.7  # share of the torque that can be lost


@uncounted
def joints(q: Array, x: int, state: Array, p: Array, work: Workspace) -> None:
    """A slipping brake loses torque with the temperature of its axle; its loss of energy heats it."""
    for axle in range(2):
        lost, heat = min(q[0] * state[x + axle], MOST), 0.0
        for wheel in (2 * axle, 2 * axle + 1):
            work.tree.effort[WHEEL + wheel] += lost * state[STICK + wheel] * state[BRAKE + wheel]
            heat += (1.0 - lost) * state[BRAKE + wheel] * abs(state[JOINT_RATE + WHEEL + wheel])
        work.rate[x + axle] = heat / q[1] - state[x + axle] / q[2]


EFFECT = Effect(
    name="brake_fade",
    sentence="The brakes lose torque as they get hot.",
    equation="T_b -> T_b (1 - f dtheta), C ddtheta/dt = P - C dtheta/tau",
    parameters=(
        Parameter("fade_per_K", "1/K", 0.002, 0.0, 0.02, "f: -10 to -30 per cent at 100 K"),
        Parameter("capacity_J_per_K", "J/K", 8e3, 100.0, 1e6, "C of one axle's brakes", shape=True),
        Parameter("cooling_s", "s", 300.0, 1.0, 1e4, "tau", shape=True),
    ),
    acts_on="longitudinal force",
    signature="Torque per brake pressure falls with the energy braked away.",
    excited_by="repeated stops",
    confusable=(Confusable("surface_friction", "friction of the ground does not recover with time"),),
    source="lumped heat balance",
    own_states=2,
)
