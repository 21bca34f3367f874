"""Delays of sensors."""

from collections.abc import Mapping

from plant.effects.effect import Confusable, Effect
from plant.effects.faults import added, of_groups, per_group
from plant.unit.sensor_parameters import SensorParameters


def sensors(q: Mapping[str, float], given: SensorParameters) -> SensorParameters:
    """Delay of each group of channels."""
    return added(given, "delay", of_groups(q, "ms"))


EFFECT = Effect(
    name="sensor_delay",
    sentence="Readings arrive later than assumed.",
    equation="y(t) = x(t - T)",
    parameters=per_group("ms", "ms", inertial=40.0, high=1000.0, si=1e-3),
    acts_on="the named channels",
    signature="Every motion arrives later, at full amplitude.",
    excited_by="fast manoeuvres",
    confusable=(
        Confusable("sensor_lag", "a lag makes fast motion smaller"),
        Confusable("clock_offset", "a clock offset is the same for every channel"),
    ),
    source="pure delay",
)
