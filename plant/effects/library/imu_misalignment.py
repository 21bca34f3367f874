"""An inertial sensor that is not square to the frame."""

from collections.abc import Mapping

from plant.effects.effect import Confusable, Effect, degrees
from plant.effects.faults import turned
from plant.unit.sensor_parameters import SensorParameters


def sensors(q: Mapping[str, float], given: SensorParameters) -> SensorParameters:
    """Turn the axes of accelerometers and gyroscopes."""
    return turned(given, q["roll_deg"], q["pitch_deg"], q["yaw_deg"])


EFFECT = Effect(
    name="imu_misalignment",
    sentence="The inertial sensor is mounted askew.",
    equation="y = R(roll, pitch, yaw) x",
    parameters=(
        degrees("roll_deg", 1.0, -20.0, 20.0, "about the longitudinal axis"),
        degrees("pitch_deg", 0.0, -20.0, 20.0, "about the lateral axis"),
        degrees("yaw_deg", 0.0, -20.0, 20.0, "about the vertical axis"),
    ),
    acts_on="accelerations, angular rates",
    signature="Gravity leaks into the level axes: 0.17 m/s2 for each degree; yaw rate leaks into roll or pitch rate.",
    excited_by="standstill, then turns",
    confusable=(Confusable("accelerometer_bias", "a bias leaves the gyroscopes as they are"),),
    source="rotation between frame and sensor axes",
)
