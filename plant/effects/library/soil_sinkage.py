"""Wheels that sink into soft ground."""

import math
from collections.abc import Mapping

import numpy as np

from plant.compiled import uncounted
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.effects.ports import carrier_motion, push_centre
from plant.physics.state import G_HEIGHT, T_NORMAL
from plant.physics.workspace import Workspace

SETTLING = 0.3  # time in which a standing wheel sinks [s]
TURNING = 0.05  # speed below which the resistance fades [m/s]


@uncounted
def sinkage(load: float, q: Array) -> float:
    """Depth of the rut [m] under a flexible wheel with its load [N] on its patch."""
    return q[6] * (max(load, 0.0) / (q[3] * q[4]) / (q[1] / q[3] + q[2])) ** (1.0 / q[0])


@uncounted
def compaction(depth: float, q: Array) -> float:
    """Force that presses the rut [N]: its work per metre."""
    return (q[1] + q[3] * q[2]) * depth ** (q[0] + 1.0) / (q[0] + 1.0)


@uncounted
def before_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """The ground is as low as the wheel has sunk."""
    work.ground[wheel, G_HEIGHT] -= state[x + wheel]


@uncounted
def after_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """Resistance of the rut, and how fast the wheel sinks on."""
    ahead, _, _ = carrier_motion(work, wheel)
    share = 1.0 if (wheel < 2) == (ahead >= 0.0) else q[5]  # the other axle runs in the ruts of the first
    resting = sinkage(work.tyres[wheel, T_NORMAL], q)
    push_centre(work, wheel, -compaction(resting, q) * share * math.tanh(ahead / TURNING))
    work.rate[x + wheel] = (resting - state[x + wheel]) * (1.0 / SETTLING + abs(ahead) / q[4])


def start(q: Mapping[str, float], x: int, state: Array, p: Array, work: Workspace) -> None:
    """A standing machine has sunk in already."""
    values = np.fromiter(q.values(), dtype=float)
    for wheel in range(4):
        state[x + wheel] = sinkage(float(work.tyres[wheel, T_NORMAL]), values)


EFFECT = Effect(
    name="soil_sinkage",
    sentence="The wheels sink into soft ground and must press a rut ahead of them.",
    equation="p = (k_c/b + k_phi) (z/c)^n, R = b (k_c/b + k_phi) z^(n+1)/(n+1)",
    parameters=(
        Parameter("exponent", "1", 1.1, 0.1, 2.0, "n; dry sand 1.1, sandy loam 0.7, clay 0.5", shape=True),
        Parameter("cohesive_kN_per_m_n1", "kN/m^(n+1)", 0.99, 0.0, 500.0, "k_c", si=1e3, shape=True),
        Parameter("frictional_kN_per_m_n2", "kN/m^(n+2)", 1528.0, 10.0, 1e5, "k_phi", si=1e3, shape=True),
        Parameter("width_m", "m", 0.52, 0.1, 1.5, "b of the tyre", shape=True),
        Parameter("patch_m", "m", 0.48, 0.1, 1.5, "length of the contact patch", shape=True),
        Parameter(
            "second_pass",
            "1",
            0.4,
            0.0,
            1.0,
            "resistance of the axle behind, over that of the first",
            shape=True,
        ),
        Parameter("softness", "1", 1.0, 0.0, 3.0, "c: depth over that of the ground described; 0 is hard"),
    ),
    acts_on="longitudinal force, torque, height",
    signature="Torque is needed to roll, growing faster than the load; the axle behind needs less.",
    excited_by="driving on soft ground, empty and loaded",
    confusable=(
        Confusable("rolling_resistance", "rolling resistance is proportional to the load"),
        Confusable("grade", "a slope changes its sign with the direction"),
    ),
    source="Bekker, Theory of Land Locomotion; Wong, Theory of Ground Vehicles, table 2.3",
    own_states=4,
)
