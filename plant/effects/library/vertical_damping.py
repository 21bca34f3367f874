"""Damping and stiffness of the tyres in bounce and pitch."""

from collections.abc import Mapping

from plant.effects.blocks import wheel_blocks
from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.physics.parameters import W_DAMPING, W_QFZ1, W_QFZ2
from plant.sheets.machine import Machine


def prepare(q: Mapping[str, float], p: Array, machine: Machine) -> None:
    """Scale the radial damper and spring."""
    for block in wheel_blocks(p):
        block[W_DAMPING] *= q["damping"]
        block[W_QFZ1] *= q["stiffness"]
        block[W_QFZ2] *= q["stiffness"]


EFFECT = Effect(
    name="vertical_damping",
    sentence="The machine rings longer or shorter on its tyres than assumed.",
    equation="N = k_k k_z rho + k_c c_z drho/dt",
    parameters=(
        Parameter("damping", "1", 0.4, 0.0, 5.0, "k_c: over the damping of the machine file", off=1.0),
        Parameter("stiffness", "1", 1.0, 0.3, 3.0, "k_k: over the stiffness of the machine file", off=1.0),
    ),
    acts_on="normal forces, pitch rate, vertical acceleration",
    signature="Ringing at 2 to 3 Hz after brake steps and bumps that dies away too slowly or too fast.",
    excited_by="brake steps and bumps",
    confusable=(
        Confusable("lug_excitation", "lugs follow the wheel's speed; the ringing keeps its frequency"),
        Confusable("hysteretic_damping", "hysteresis damps every frequency alike"),
    ),
    source="free vibration on the tyres",
)
