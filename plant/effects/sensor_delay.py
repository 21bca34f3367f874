"""Delays of sensors."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from plant.effects.effect import Confusable, Effect, Parameter
from plant.effects.faults import added, of_groups

if TYPE_CHECKING:
    from plant.sensors import SensorParameters


def sensors(q: Mapping[str, float], given: "SensorParameters") -> "SensorParameters":
    """Delay of each group of channels."""
    return added(given, "delay", of_groups(q, "ms"))


EFFECT = Effect(
    name="sensor_delay",
    sentence="Readings arrive later than assumed.",
    equation="y(t) = x(t - T)",
    parameters=(
        Parameter("inertial_ms", "ms", 40.0, 0.0, 1000.0, "of the accelerometers and gyroscopes", si=1e-3),
        Parameter("wheel_ms", "ms", 0.0, 0.0, 1000.0, "of the wheel speeds and torques", si=1e-3),
        Parameter("pressure_ms", "ms", 0.0, 0.0, 1000.0, "of the cylinder pressures", si=1e-3),
        Parameter("articulation_ms", "ms", 0.0, 0.0, 1000.0, "of the articulation angle and rate", si=1e-3),
    ),
    acts_on="the named channels",
    signature="Every motion arrives later, at full amplitude.",
    excited_by="fast manoeuvres",
    confusable=(
        Confusable("sensor_lag", "a lag makes fast motion smaller"),
        Confusable("clock_offset", "a clock offset is the same for every channel"),
    ),
    source="pure delay",
    sensors=sensors,
)
