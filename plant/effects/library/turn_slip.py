"""Moment of a tyre that is turned on the spot."""

import math

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.effects.ports import carrier_motion, push_wheel
from plant.physics.state import T_NORMAL
from plant.physics.workspace import Workspace

SLOWEST = 0.02  # speed below which turning counts as turning on the spot [m/s]


@uncounted
def after_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """Moment against the yaw rate of the wheel, largest on the spot."""
    ahead, _, turning = carrier_motion(work, wheel)
    load = max(work.tyres[wheel, T_NORMAL], 0.0)
    moment = q[0] * load * math.sqrt(load) / (3.0 * math.sqrt(q[1]))
    push_wheel(work, wheel, 0.0, 0.0, -moment * math.tanh(q[2] * turning / (abs(ahead) + SLOWEST)))


EFFECT = Effect(
    name="turn_slip",
    sentence="The tyres resist being turned on the spot.",
    equation="M_z = -mu N^1.5/(3 sqrt(p)) tanh(l omega_z/|V|)",
    parameters=(
        Parameter("friction", "1", 0.75, 0.0, 2.0, "mu of the sliding patch"),
        Parameter("pressure_bar", "bar", 3.5, 0.5, 10.0, "p in the contact patch", si=1e5, shape=True),
        Parameter("length_m", "m", 0.25, 0.01, 1.0, "l: half the contact's length", shape=True),
    ),
    acts_on="steering joint torque, steering pressure",
    signature="Torque of the steering joint when steering at standstill, gone at speed.",
    excited_by="steering at creep",
    confusable=(
        Confusable("steering_friction", "friction of the joint does not depend on the speed of the machine"),
    ),
    source="Pacejka, Tire and Vehicle Dynamics, 3rd ed., chapter 9.2",
)
