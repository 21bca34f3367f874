"""Offset and scale of the pressure sensors."""

from collections.abc import Mapping

from plant.effects.effect import Confusable, Effect, Parameter
from plant.effects.faults import GROUPS, added, scaled
from plant.unit.sensor_parameters import SensorParameters


def sensors(q: Mapping[str, float], given: SensorParameters) -> SensorParameters:
    """Offset and scale of all of them."""
    those = GROUPS["pressure"]
    return scaled(
        added(given, "bias", dict.fromkeys(those, q["offset_kPa"])), dict.fromkeys(those, q["scale_percent"])
    )


EFFECT = Effect(
    name="pressure_error",
    sentence="The pressure sensors have drifted.",
    equation="y = (1 + s) p + b",
    parameters=(
        Parameter("offset_kPa", "kPa", 200.0, -5000.0, 5000.0, "b", si=1e3),
        Parameter("scale_percent", "%", 0.0, -50.0, 50.0, "s", si=0.01),
    ),
    acts_on="lift, tilt and steering pressures",
    signature="An offset also with the bucket on the ground, and in the steering line that does not push.",
    excited_by="bucket on the ground, then lifted",
    confusable=(Confusable("payload_mass", "a payload is gone with the bucket on the ground"),),
    source="linear sensor error model",
)
