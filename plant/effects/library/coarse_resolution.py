"""Coarser quantisation of the sensors."""

from collections.abc import Mapping

from plant.effects.effect import Confusable, Effect, Parameter
from plant.effects.faults import coarser
from plant.unit.sensor_parameters import SensorParameters


def sensors(q: Mapping[str, float], given: SensorParameters) -> SensorParameters:
    """Larger steps of every channel."""
    return coarser(given, q["factor"])


EFFECT = Effect(
    name="coarse_resolution",
    sentence="The readings come in larger steps than assumed.",
    equation="y = k r round(x/(k r))",
    parameters=(Parameter("factor", "1", 8.0, 1.0, 1000.0, "k over the resolution given", off=1.0),),
    acts_on="all channels",
    signature="Residuals uniform within a step, none beyond.",
    excited_by="slow motion",
    confusable=(Confusable("sensor_dropout", "missing samples come with the state error"),),
    source="uniform quantisation",
)
