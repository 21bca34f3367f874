"""What the machine and the test instrumentation send: which value goes into which signal.

Signal names of the DBC meet names of the plant here and in `plant.reception`, and nowhere else of the plant.
"""

import math
from collections.abc import Mapping

import numpy as np

from dbc.packing import Signals
from plant.driver import Demand
from plant.sensors import CHANNELS, INDEX, WHEELS, Floats, Readings
from plant.truth import Truth

MACHINE = "Machine"
TEST_RIG = "TestRig"
_WHEEL_MESSAGES = {
    "front_left": "FrontLeft",
    "front_right": "FrontRight",
    "rear_left": "RearLeft",
    "rear_right": "RearRight",
}


def _wheel_pair(quantity: str, axle: str, unit: str) -> Signals:
    """Signals of one axle's message: both values and both states."""
    return {
        "Left": (unit, f"{quantity}_{axle}_left"),
        "Right": (unit, f"{quantity}_{axle}_right"),
        "LeftState": ("1", f"{quantity}_{axle}_left health"),
        "RightState": ("1", f"{quantity}_{axle}_right health"),
    }


HEALTH_GROUPS: Mapping[str, tuple[str, ...]] = {
    "articulation health": ("articulation_angle", "articulation_rate"),
    "acceleration health": ("acceleration_x", "acceleration_y", "acceleration_z"),
    "rates health": ("roll_rate", "pitch_rate", "yaw_rate"),
    "linkage health": ("lift_arm_angle", "tilt_angle"),
    **{
        f"{quantity}_{wheel} health": (f"{quantity}_{wheel}",)
        for quantity in ("wheel_speed", "wheel_torque")
        for wheel in WHEELS
    },
    **{f"{line} health": (line,) for line in ("steering_pressure_left", "steering_pressure_right")},
}
"""State signals: a frame's state is the worst of its channels'."""

MACHINE_MESSAGES: Mapping[str, Signals] = {
    "Articulation": {
        "ArticulationAngle": ("rad", "articulation_angle"),
        "ArticulationRate": ("rad/s", "articulation_rate"),
        "SampleSequence": ("1", "sample sequence"),
        "State": ("1", "articulation health"),
    },
    "WheelSpeedsFront": _wheel_pair("wheel_speed", "front", "rad/s"),
    "WheelSpeedsRear": _wheel_pair("wheel_speed", "rear", "rad/s"),
    "WheelTorquesFront": _wheel_pair("wheel_torque", "front", "N.m"),
    "WheelTorquesRear": _wheel_pair("wheel_torque", "rear", "N.m"),
    "BodyAcceleration": {
        "Longitudinal": ("m/s2", "acceleration_x"),
        "Lateral": ("m/s2", "acceleration_y"),
        "Vertical": ("m/s2", "acceleration_z"),
        "State": ("1", "acceleration health"),
    },
    "BodyRates": {
        "RollRate": ("rad/s", "roll_rate"),
        "PitchRate": ("rad/s", "pitch_rate"),
        "YawRate": ("rad/s", "yaw_rate"),
        "State": ("1", "rates health"),
    },
    "SlopeSensor": {
        "PitchAngle": ("rad", "pitch_angle"),
        "RollAngle": ("rad", "roll_angle"),
        "PitchRate": ("rad/s", "pitch_rate"),
    },
    "LiftPressure": {"LiftCylinderPressure": ("Pa", "lift_pressure")},
    "TiltPressure": {"TiltCylinderPressure": ("Pa", "tilt_pressure")},
    "LinkageAngles": {
        "LiftArmAngle": ("rad", "lift_arm_angle"),
        "TiltAngle": ("rad", "tilt_angle"),
        "State": ("1", "linkage health"),
    },
    "SteeringPressures": {
        "LeftLine": ("Pa", "steering_pressure_left"),
        "RightLine": ("Pa", "steering_pressure_right"),
        "LeftLineState": ("1", "steering_pressure_left health"),
        "RightLineState": ("1", "steering_pressure_right health"),
    },
    "DriverDemand": {
        "TorqueDemand": ("1", "torque demand"),
        "BrakeDemand": ("1", "brake demand"),
        "ArticulationRateDemand": ("rad/s", "articulation rate demand"),
        "LiftDemand": ("1", "lift demand"),
        "TiltDemand": ("1", "tilt demand"),
    },
    "VehicleSpeed": {"WheelBasedVehicleSpeed": ("m/s", "ground speed")},
}

REFERENCE_MESSAGES: Mapping[str, Signals] = {
    **{
        f"WheelForce{message}": {
            "Longitudinal": ("N", f"longitudinal_force_{wheel}"),
            "Lateral": ("N", f"lateral_force_{wheel}"),
            "Normal": ("N", f"normal_force_{wheel}"),
            "AligningMoment": ("N.m", f"aligning_moment_{wheel}"),
        }
        for wheel, message in _WHEEL_MESSAGES.items()
    },
    "BodyVelocity": {
        "Longitudinal": ("m/s", "velocity_x"),
        "Lateral": ("m/s", "velocity_y"),
        "Vertical": ("m/s", "velocity_z"),
    },
    "BodyAttitude": {"Roll": ("rad", "roll"), "Pitch": ("rad", "pitch"), "Yaw": ("rad", "yaw")},
    "BodyAccelerationReference": {
        "Longitudinal": ("m/s2", "acceleration_x"),
        "Lateral": ("m/s2", "acceleration_y"),
        "Vertical": ("m/s2", "acceleration_z"),
    },
    "JointLoad": {"JointTorque": ("N.m", "joint_torque"), "OscillationAngle": ("rad", "oscillation_angle")},
    "SatelliteSpeed": {"GroundSpeed": ("m/s", "ground_speed"), "Course": ("rad", "course")},
}


MACHINE_SOURCES = (
    *CHANNELS,
    *HEALTH_GROUPS,
    "sample sequence",
    "torque demand",
    "brake demand",
    "articulation rate demand",
    "lift demand",
    "tilt demand",
    "ground speed",
)
_HEALTH = slice(len(CHANNELS), len(CHANNELS) + len(HEALTH_GROUPS))
_HEALTH_CHANNELS = tuple([INDEX[channel] for channel in group] for group in HEALTH_GROUPS.values())


def machine_values(readings: Readings, demand: Demand, *, sequence: int, ground_speed: float) -> Floats:
    """Everything the machine sends, SI, in the order of MACHINE_SOURCES."""
    values = np.zeros(len(MACHINE_SOURCES))
    values[: _HEALTH.start] = readings.values
    if readings.health.any():
        values[_HEALTH] = [readings.health[channels].max() for channels in _HEALTH_CHANNELS]
    values[_HEALTH.stop :] = (
        sequence,
        demand.torque,
        demand.brake,
        demand.articulation_rate,
        demand.lift,
        demand.tilt,
        abs(ground_speed),
    )
    return values


_TRUE: Mapping[str, int] = {
    **{
        f"{field}_{wheel}": Truth.fields[field].at + i
        for field in ("longitudinal_force", "lateral_force", "normal_force", "aligning_moment")
        for i, wheel in enumerate(WHEELS)
    },
    **{
        f"{field}_{axis}": Truth.fields[field].at + i
        for field in ("velocity", "acceleration")
        for i, axis in enumerate("xyz")
    },
    **{name: Truth.fields[name].at for name in ("roll", "pitch", "joint_torque", "oscillation_angle")},
}
"""What the test instrumentation measures directly: its place in a row of truth."""

_TRUE_PLACES = np.array(list(_TRUE.values()))
REFERENCE_SOURCES = (*_TRUE, "yaw", "ground_speed", "course")


def reference_values(truth: Truth) -> Floats:
    """Everything the test instrumentation sends, SI, in the order of REFERENCE_SOURCES."""
    values = np.empty(len(REFERENCE_SOURCES))
    values[:-3] = truth.row[_TRUE_PLACES]
    (forward, left, _), yaw = truth.velocity.tolist(), truth.yaw
    course = (yaw + math.atan2(left, forward)) % math.tau
    values[-3:] = (math.remainder(yaw, math.tau), math.hypot(forward, left), course)
    return values
