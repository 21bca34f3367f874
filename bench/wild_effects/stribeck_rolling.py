"""A law of the loader's wild arms: dry rolling friction that falls with speed."""

import math

from plant.compiled import uncounted
from plant.effects.effect import Array, Effect, Parameter
from plant.effects.ports import resist_rolling, spin
from plant.physics.parameters import W_RADIUS
from plant.physics.workspace import Workspace


@uncounted
def after_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """Moment against the wheel's spin that decays over a speed."""
    turning = spin(work, wheel)
    speed = abs(turning) * work.local[wheel, W_RADIUS]
    resist_rolling(work, wheel, turning, q[0] * math.exp(-speed / q[1]))


EFFECT = Effect(
    name="stribeck_rolling",
    sentence="Dry rolling friction falls with speed.",
    equation="M_y = -f exp(-|V|/V0) N R0 sgn(omega)",
    parameters=(
        Parameter("coefficient", "1", 0.01, 0.0, 0.1, "f"),
        Parameter("decay_m_per_s", "m/s", 1.0, 0.1, 10.0, "V0", shape=True),
    ),
    acts_on="wheel torque, longitudinal force, speed",
    signature="Resistance that is largest at creep.",
    excited_by="driving at several speeds",
    source="Stribeck's law",
)
