"""Scale of the torque signals."""

from collections.abc import Mapping

from plant.effects.effect import Confusable, Effect, Parameter
from plant.effects.faults import scaled, wheels
from plant.unit.sensor_parameters import SensorParameters


def sensors(q: Mapping[str, float], given: SensorParameters) -> SensorParameters:
    """Scale of front and rear signals."""
    return scaled(given, wheels("wheel_torque", q["front_percent"], q["rear_percent"]))


EFFECT = Effect(
    name="torque_scale",
    sentence="The reported torques are wrong by a factor.",
    equation="y = (1 + s) T",
    parameters=(
        Parameter("front_percent", "%", 5.0, -100.0, 100.0, "s of the front wheels", si=0.01),
        Parameter("rear_percent", "%", 5.0, -100.0, 100.0, "s of the rear wheels", si=0.01),
    ),
    acts_on="wheel torque",
    signature="Torque and acceleration disagree by the same factor in traction and braking.",
    excited_by="traction and braking",
    confusable=(Confusable("torque_error", "not distinguishable by the reported torque alone"),),
    source="linear sensor error model",
)
