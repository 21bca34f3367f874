"""Bias of the accelerometers."""

from collections.abc import Mapping

from plant.effects.effect import Confusable, Effect, Parameter
from plant.effects.faults import added
from plant.unit.sensor_parameters import SensorParameters


def sensors(q: Mapping[str, float], given: SensorParameters) -> SensorParameters:
    """Bias of each axis."""
    return added(given, "bias", {f"specific_force_{axis}": q[f"{axis}_m_s2"] for axis in "xyz"})


EFFECT = Effect(
    name="accelerometer_bias",
    sentence="The accelerometers read a constant beside the truth.",
    equation="y = a + b",
    parameters=(
        Parameter("x_m_s2", "m/s2", 0.15, -5.0, 5.0, "b"),
        Parameter("y_m_s2", "m/s2", 0.0, -5.0, 5.0, "b"),
        Parameter("z_m_s2", "m/s2", 0.0, -5.0, 5.0, "b"),
    ),
    acts_on="accelerations",
    signature="A constant that stays when the heading is reversed.",
    excited_by="standstill, both headings",
    confusable=(
        Confusable("grade", "a slope changes its sign with the heading"),
        Confusable(
            "imu_misalignment", "misalignment mixes gravity in: the constant comes with 9.81 times the angle"
        ),
    ),
    source="IEEE 1293 accelerometer error model",
)
