"""Bias of the gyroscopes."""

from collections.abc import Mapping

from plant.effects.effect import Confusable, Effect, Parameter
from plant.effects.faults import DEGREE, added
from plant.unit.sensor_parameters import SensorParameters


def sensors(q: Mapping[str, float], given: SensorParameters) -> SensorParameters:
    """Bias of each axis."""
    return added(
        given,
        "bias",
        {"roll_rate": q["roll_deg_s"], "pitch_rate": q["pitch_deg_s"], "yaw_rate": q["yaw_deg_s"]},
    )


EFFECT = Effect(
    name="gyro_bias",
    sentence="The gyroscopes read a constant rate at rest.",
    equation="y = omega + b",
    parameters=(
        Parameter("roll_deg_s", "deg/s", 0.0, -20.0, 20.0, "b", si=DEGREE),
        Parameter("pitch_deg_s", "deg/s", 0.0, -20.0, 20.0, "b", si=DEGREE),
        Parameter("yaw_deg_s", "deg/s", 0.4, -20.0, 20.0, "b", si=DEGREE),
    ),
    acts_on="angular rates",
    signature="A constant at standstill and in motion alike.",
    excited_by="standstill",
    confusable=(Confusable("axle_position", "a wrong axle position needs steering to show"),),
    source="IEEE 952 gyroscope error model",
)
