"""Offset of the articulation sensor."""

from collections.abc import Mapping

from plant.effects.effect import Confusable, Effect, Parameter, degrees
from plant.effects.faults import added, scaled
from plant.unit.sensor_parameters import SensorParameters


def sensors(q: Mapping[str, float], given: SensorParameters) -> SensorParameters:
    """Offset and scale of angle and rate."""
    return scaled(
        added(given, "bias", {"articulation_angle": q["offset_deg"]}),
        {"articulation_angle": q["scale_percent"], "articulation_rate": q["scale_percent"]},
    )


EFFECT = Effect(
    name="articulation_offset",
    sentence="The articulation sensor is not zero straight ahead.",
    equation="y = (1 + s) delta + b",
    parameters=(
        degrees("offset_deg", 0.5, -10.0, 10.0, "b"),
        Parameter("scale_percent", "%", 0.0, -30.0, 30.0, "s", si=0.01),
    ),
    acts_on="articulation angle",
    signature="The machine goes straight at an angle other than zero.",
    excited_by="straight ahead in both directions",
    confusable=(Confusable("steering_play", "play gives a band, not an offset"),),
    source="linear sensor error model",
)
