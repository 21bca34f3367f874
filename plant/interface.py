"""What the machine and the test instrumentation send: which value goes into which signal.

Signal names of the DBC meet names of the plant here and in `plant.reception`, and nowhere else of the plant.
"""

import math
from collections.abc import Mapping

from dbc.packing import Signals
from plant.driver import Demand
from plant.sensors import CHANNELS, INDEX, WHEELS, Health, Readings
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
}
"""State signals: a frame's state is the worst of its channels'."""

_ALL_WELL: Mapping[str, float] = dict.fromkeys(HEALTH_GROUPS, Health.OK)

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


def machine_values(
    readings: Readings, demand: Demand, *, sequence: int, ground_speed: float
) -> dict[str, float]:
    """Everything the machine sends, SI, by source name."""
    values: dict[str, float] = dict(zip(CHANNELS, readings.values.tolist(), strict=True))
    values.update(_ALL_WELL)
    if readings.health.any():
        for name, channels in HEALTH_GROUPS.items():
            values[name] = int(max(readings.health[INDEX[channel]] for channel in channels))
    values["sample sequence"] = sequence
    values["torque demand"] = demand.torque
    values["brake demand"] = demand.brake
    values["articulation rate demand"] = demand.articulation_rate
    values["lift demand"] = demand.lift
    values["tilt demand"] = demand.tilt
    values["ground speed"] = abs(ground_speed)
    return values


def reference_values(truth: Truth) -> dict[str, float]:
    """Everything the test instrumentation sends, SI, by source name."""
    values: dict[str, float] = {
        f"{quantity}_{wheel}": value
        for quantity in ("longitudinal_force", "lateral_force", "normal_force", "aligning_moment")
        for wheel, value in zip(WHEELS, getattr(truth, quantity), strict=True)
    }
    for quantity in ("velocity", "acceleration"):
        for axis, value in zip("xyz", getattr(truth, quantity), strict=True):
            values[f"{quantity}_{axis}"] = value
    forward, left = values["velocity_x"], values["velocity_y"]
    values.update(
        roll=truth.roll,
        pitch=truth.pitch,
        yaw=math.remainder(truth.yaw, math.tau),
        joint_torque=truth.joint_torque,
        oscillation_angle=truth.oscillation_angle,
        ground_speed=math.hypot(forward, left),
        course=(truth.yaw + math.atan2(left, forward)) % math.tau,
    )
    return values
