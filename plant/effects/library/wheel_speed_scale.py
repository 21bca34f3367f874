"""Scale of the wheel-speed sensors."""

from collections.abc import Mapping

from plant.effects.effect import Confusable, Effect, Parameter
from plant.effects.faults import scaled, wheels
from plant.unit.sensor_parameters import SensorParameters


def sensors(q: Mapping[str, float], given: SensorParameters) -> SensorParameters:
    """Scale of front and rear sensors."""
    return scaled(given, wheels("wheel_speed", q["front_percent"], q["rear_percent"]))


EFFECT = Effect(
    name="wheel_speed_scale",
    sentence="The wheel-speed sensors count wrongly.",
    equation="y = (1 + s) omega",
    parameters=(
        Parameter("front_percent", "%", 2.0, -50.0, 50.0, "s of the front wheels", si=0.01),
        Parameter("rear_percent", "%", 2.0, -50.0, 50.0, "s of the rear wheels", si=0.01),
    ),
    acts_on="wheel speeds, slip",
    signature="Apparent slip at zero torque in proportion to speed.",
    excited_by="coasting",
    confusable=(Confusable("tyre_wear", "worn tyres change the torque per force too"),),
    source="linear sensor error model",
)
