"""Samples that are missing."""

from collections.abc import Mapping

from plant.effects.effect import Confusable, Effect
from plant.effects.faults import added, of_groups, per_group
from plant.unit.sensor_parameters import SensorParameters


def sensors(q: Mapping[str, float], given: SensorParameters) -> SensorParameters:
    """Probability of each group of channels."""
    return added(given, "dropout", of_groups(q, "percent"))


EFFECT = Effect(
    name="sensor_dropout",
    sentence="Samples go missing; the last one is repeated.",
    equation="y_k = y_(k-1) with probability P",
    parameters=per_group("percent", "%", inertial=5.0, high=100.0, si=0.01),
    acts_on="the named channels",
    signature="Repeated values with the state error.",
    excited_by="any",
    confusable=(Confusable("sensor_lag", "a lag leaves no repeated values"),),
    source="Bernoulli loss",
)
