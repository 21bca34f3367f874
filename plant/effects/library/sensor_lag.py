"""Low-pass filters of sensors."""

from collections.abc import Mapping

from plant.effects.effect import Confusable, Effect
from plant.effects.faults import added, of_groups, per_group
from plant.unit.sensor_parameters import SensorParameters


def sensors(q: Mapping[str, float], given: SensorParameters) -> SensorParameters:
    """Time constant of each group of channels."""
    return added(given, "lag", of_groups(q, "ms"))


EFFECT = Effect(
    name="sensor_lag",
    sentence="Sensors are filtered more than assumed.",
    equation="tau dy/dt + y = x",
    parameters=per_group("ms", "ms", inertial=50.0, high=1000.0, si=1e-3),
    acts_on="the named channels",
    signature="Fast motion arrives later and smaller.",
    excited_by="fast manoeuvres",
    confusable=(
        Confusable("sensor_delay", "a delay leaves the amplitude"),
        Confusable("motor_lag", "a lag of the motor shows in the motion, not in the reading"),
    ),
    source="first-order low-pass",
)
