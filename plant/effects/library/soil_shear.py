"""Traction on ground that shears."""

import math
from collections.abc import Mapping

from plant.compiled import uncounted
from plant.effects.blocks import wheel_blocks
from plant.effects.effect import Array, Confusable, Effect, Parameter, degrees
from plant.effects.ports import carrier_motion, push_centre
from plant.physics.parameters import W_PCX1, W_PDX1, W_PDX2, W_PEX1, W_PEX2, W_PEX3, W_PKX1, W_PKX2, W_PKX3
from plant.physics.state import T_NORMAL
from plant.physics.workspace import Workspace
from plant.sheets.machine import Machine

TURNING = 0.05  # speed below which the resistance fades [m/s]


def prepare(q: Mapping[str, float], p: Array, machine: Machine) -> None:
    """A Magic Formula without peak: force rises towards the soil's friction as the soil is sheared."""
    grip = math.tan(q["friction_angle_deg"])
    for block in wheel_blocks(p):
        block[W_PCX1], block[W_PEX1], block[W_PEX2], block[W_PEX3] = 1.0, 0.0, 0.0, 0.0
        block[W_PDX1], block[W_PDX2] = grip, 0.0
        block[W_PKX1], block[W_PKX2], block[W_PKX3] = grip * q["patch_m"] / (2.0 * q["shear_mm"]), 0.0, 0.0


@uncounted
def after_tyre(q: Array, x: int, state: Array, p: Array, wheel: int, work: Workspace) -> None:
    """Soil is pushed ahead of a wheel that carries load."""
    if work.tyres[wheel, T_NORMAL] > 0.0:
        ahead, _, _ = carrier_motion(work, wheel)
        push_centre(work, wheel, -q[3] * math.tanh(ahead / TURNING))


EFFECT = Effect(
    name="soil_shear",
    sentence="The ground shears under the tyres: traction has no peak and grows up to large slip.",
    equation="F_x = N tan(phi) s/sqrt(1 + s^2), s = kappa l/(2 K); R = R_b",
    parameters=(
        degrees("friction_angle_deg", 30.0, 5.0, 50.0, "phi of the soil", shape=True),
        Parameter("shear_mm", "mm", 15.0, 1.0, 100.0, "K: shear displacement, 10 to 25", si=1e-3, shape=True),
        Parameter("patch_m", "m", 0.48, 0.1, 1.5, "l of the contact patch", shape=True),
        Parameter("bulldozing_N", "N", 0.0, 0.0, 20e3, "R_b of each wheel: 1 to 5 kN in loose soil"),
    ),
    acts_on="longitudinal force over slip",
    signature="No peak: the force still rises at large slip.",
    excited_by="high slip, as in a pile",
    confusable=(
        Confusable("surface_friction", "friction scales the peak and leaves the slope at small slip"),
    ),
    source="Janosi and Hanamoto 1961; Wong, Theory of Ground Vehicles, chapter 2",
)
