"""Stops of the oscillating rear axle."""

from collections.abc import Mapping

from plant.effects.effect import Array, Confusable, Effect, Parameter, degrees
from plant.machine import Machine
from plant.parameters import P_STOP_ANGLE, P_STOP_STIFFNESS


def prepare(q: Mapping[str, float], p: Array, machine: Machine) -> None:
    """Another angle and stiffness of the stops."""
    p[P_STOP_ANGLE] = q["angle_deg"]
    p[P_STOP_STIFFNESS] = q["stiffness_N_m_per_rad"]


EFFECT = Effect(
    name="oscillation_stops",
    sentence="The rear axle meets its stops at another angle, or harder, than assumed.",
    equation="M_p = -k_s (phi_o -+ phi_s) beyond +-phi_s",
    parameters=(
        degrees("angle_deg", 8.0, 0.5, 45.0, "phi_s"),
        Parameter("stiffness_N_m_per_rad", "N m/rad", 2.0e6, 1e4, 2e7, "k_s: 1e6 to 5e6"),
    ),
    acts_on="difference of the rear wheels' normal forces, roll",
    signature="Beyond one angle the rear axle takes its share of the roll moment, suddenly.",
    excited_by="ditch, kerb under one wheel, tipping",
    confusable=(Confusable("pivot_friction", "friction has no threshold angle"),),
    source="contact spring at the stops",
    prepare=prepare,
)
