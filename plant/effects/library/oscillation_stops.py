"""Stops of the oscillating rear axle."""

from collections.abc import Mapping

from plant.effects.effect import Array, Confusable, Effect, Parameter, degrees
from plant.physics.parameters import P_STOP_ANGLE, P_STOP_STIFFNESS
from plant.sheets.machine import Machine


def prepare(q: Mapping[str, float], p: Array, machine: Machine) -> None:
    """Another angle and stiffness of the stops."""
    p[P_STOP_ANGLE] = max(p[P_STOP_ANGLE] - q["narrower_deg"], 0.0)
    p[P_STOP_STIFFNESS] *= q["stiffness"]


EFFECT = Effect(
    name="oscillation_stops",
    sentence="The rear axle meets its stops at another angle, or harder, than assumed.",
    equation="M_p = -k k_s (phi_o -+ (phi_s - d)) beyond the stops",
    parameters=(
        # the axle seldom swings far: on an even road only stops that leave it no room show
        degrees("narrower_deg", 5.0, -20.0, 20.0, "d", trial_steps=(5.0, 10.0, 15.0)),
        Parameter("stiffness", "1", 1.0, 0.1, 10.0, "k: over the stiffness of the machine file", off=1.0),
    ),
    acts_on="difference of the rear wheels' normal forces, roll",
    signature="Beyond one angle the rear axle takes its share of the roll moment, suddenly.",
    excited_by="ditch, kerb under one wheel, tipping",
    confusable=(Confusable("pivot_friction", "friction has no threshold angle"),),
    source="contact spring at the stops",
)
