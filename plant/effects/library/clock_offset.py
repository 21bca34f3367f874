"""A clock that is late against the others."""

from collections.abc import Mapping

from plant.effects.effect import Confusable, Effect, Parameter
from plant.effects.faults import added
from plant.unit.sensor_parameters import SensorParameters
from plant.unit.signals import CHANNELS


def sensors(q: Mapping[str, float], given: SensorParameters) -> SensorParameters:
    """The same delay for every channel of the machine's bus."""
    return added(given, "delay", dict.fromkeys(CHANNELS, q["late_ms"]))


EFFECT = Effect(
    name="clock_offset",
    sentence="The machine's recorder is late against the reference instruments.",
    equation="t_machine = t_reference + T",
    parameters=(Parameter("late_ms", "ms", 60.0, 0.0, 1000.0, "T", si=1e-3),),
    acts_on="all channels of the machine bus against the reference bus",
    signature="All channels of one bus are late by the same time.",
    excited_by="any transient",
    confusable=(Confusable("sensor_delay", "a sensor's delay belongs to its own channels"),),
    source="recorders without a common clock",
)
