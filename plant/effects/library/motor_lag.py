"""Lag of the drive motors."""

from collections.abc import Mapping

from plant.effects.effect import Array, Confusable, Effect, Parameter
from plant.physics.parameters import P_DRIVE_LAG
from plant.sheets.machine import Machine


def prepare(q: Mapping[str, float], p: Array, machine: Machine) -> None:
    """A longer time constant."""
    p[P_DRIVE_LAG] += q["lag_ms"]


EFFECT = Effect(
    name="motor_lag",
    sentence="The motors follow their demand later than assumed.",
    equation="tau dT/dt + T = T_demand",
    parameters=(Parameter("lag_ms", "ms", 50.0, 0.0, 1000.0, "added to tau: 20 to 80", si=1e-3),),
    acts_on="wheel torque, longitudinal force",
    signature="Torque lags by a time that is the same at every speed.",
    excited_by="torque steps at several speeds",
    confusable=(Confusable("longitudinal_relaxation", "a relaxation length fades with speed"),),
    source="first-order torque response",
)
