"""Samples that are missing."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from plant.effects.effect import Confusable, Effect, Parameter
from plant.effects.faults import added, of_groups

if TYPE_CHECKING:
    from plant.sensors import SensorParameters


def sensors(q: Mapping[str, float], given: "SensorParameters") -> "SensorParameters":
    """Probability of each group of channels."""
    return added(given, "dropout", of_groups(q, "percent"))


EFFECT = Effect(
    name="sensor_dropout",
    sentence="Samples go missing; the last one is repeated.",
    equation="y_k = y_(k-1) with probability P",
    parameters=(
        Parameter(
            "inertial_percent", "%", 5.0, 0.0, 100.0, "P of the accelerometers and gyroscopes", si=0.01
        ),
        Parameter("wheel_percent", "%", 0.0, 0.0, 100.0, "P of the wheel speeds and torques", si=0.01),
        Parameter("pressure_percent", "%", 0.0, 0.0, 100.0, "P of the cylinder pressures", si=0.01),
        Parameter(
            "articulation_percent", "%", 0.0, 0.0, 100.0, "P of the articulation angle and rate", si=0.01
        ),
    ),
    acts_on="the named channels",
    signature="Repeated values with the state error.",
    excited_by="any",
    confusable=(Confusable("sensor_lag", "a lag leaves no repeated values"),),
    source="Bernoulli loss",
    sensors=sensors,
)
