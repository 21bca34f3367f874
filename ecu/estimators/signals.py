"""The ECU's signal table: what goes into one cycle of the estimators, and what comes out.

One row per signal. Its marker (`ecu.bus_signals`) names the signal on the bus; the ECU's inputs, its frames and their
validity flags are derived from the rows. Everything is a float in SI units: flags are 0 or 1, wheels are 1 FL, 2 FR,
3 RL, 4 RR. An input that is not usable still has a number (its last good one); its flag says that the estimators
must not rely on it. `ecu.validity` decides which estimates are valid.
"""

from typing import Annotated, NamedTuple

from ecu.bus_signals import Received, Sent, Usable


class Inputs(NamedTuple):
    """What the machine reports, and which of it is usable (1) or not (0).

    In this order: the period, the inputs from the bus, their flags, the ECU's own limits.
    """

    dt: float  # time since the previous cycle [s]
    articulation_angle: Annotated[
        float,
        Received("Articulation", "ArticulationAngle", "rad", "articulation", "articulation_step", "State"),
    ]
    articulation_rate: Annotated[
        float, Received("Articulation", "ArticulationRate", "rad/s", "articulation_rate", state="State")
    ]
    articulation_rate_demand: Annotated[
        float,
        Received("DriverDemand", "ArticulationRateDemand", "rad/s", "articulation_rate", sensed=False),
    ]
    brake_demand: Annotated[float, Received("DriverDemand", "BrakeDemand", "1", sensed=False)]
    # the levers' shares of their way; up and back positive
    lift_demand: Annotated[float, Received("DriverDemand", "LiftDemand", "1", sensed=False)]
    tilt_demand: Annotated[float, Received("DriverDemand", "TiltDemand", "1", sensed=False)]
    wheel_speed_1: Annotated[
        float, Received("WheelSpeedsFront", "Left", "rad/s", "wheel_speed", "wheel_speed_step", "LeftState")
    ]
    wheel_speed_2: Annotated[
        float, Received("WheelSpeedsFront", "Right", "rad/s", "wheel_speed", "wheel_speed_step", "RightState")
    ]
    wheel_speed_3: Annotated[
        float, Received("WheelSpeedsRear", "Left", "rad/s", "wheel_speed", "wheel_speed_step", "LeftState")
    ]
    wheel_speed_4: Annotated[
        float, Received("WheelSpeedsRear", "Right", "rad/s", "wheel_speed", "wheel_speed_step", "RightState")
    ]
    wheel_torque_1: Annotated[
        float, Received("WheelTorquesFront", "Left", "N.m", "wheel_torque", state="LeftState")
    ]
    wheel_torque_2: Annotated[
        float, Received("WheelTorquesFront", "Right", "N.m", "wheel_torque", state="RightState")
    ]
    wheel_torque_3: Annotated[
        float, Received("WheelTorquesRear", "Left", "N.m", "wheel_torque", state="LeftState")
    ]
    wheel_torque_4: Annotated[
        float, Received("WheelTorquesRear", "Right", "N.m", "wheel_torque", state="RightState")
    ]
    # the inertial sensor on the rear frame: what an accelerometer reads, gravity's reaction included
    specific_force_x: Annotated[
        float, Received("BodyAcceleration", "Longitudinal", "m/s2", "acceleration", state="State")
    ]
    specific_force_y: Annotated[
        float, Received("BodyAcceleration", "Lateral", "m/s2", "acceleration", state="State")
    ]
    specific_force_z: Annotated[
        float, Received("BodyAcceleration", "Vertical", "m/s2", "acceleration", state="State")
    ]
    roll_rate: Annotated[float, Received("BodyRates", "RollRate", "rad/s", "rate", state="State")]
    pitch_rate: Annotated[float, Received("BodyRates", "PitchRate", "rad/s", "rate", state="State")]
    yaw_rate: Annotated[float, Received("BodyRates", "YawRate", "rad/s", "rate", state="State")]
    pitch: Annotated[float, Received("SlopeSensor", "PitchAngle", "rad", "slope", "slope_step")]
    roll: Annotated[float, Received("SlopeSensor", "RollAngle", "rad", "slope", "slope_step")]
    # head sides of the cylinders
    lift_pressure: Annotated[float, Received("LiftPressure", "LiftCylinderPressure", "Pa", "pressure")]
    tilt_pressure: Annotated[float, Received("TiltPressure", "TiltCylinderPressure", "Pa", "pressure")]
    lift_arm_angle: Annotated[
        float, Received("LinkageAngles", "LiftArmAngle", "rad", "arm", "linkage_step", "State")
    ]
    tilt_angle: Annotated[
        float, Received("LinkageAngles", "TiltAngle", "rad", "tilt", "linkage_step", "State")
    ]
    demand_usable: Annotated[
        float, Usable(("articulation_rate_demand", "brake_demand", "lift_demand", "tilt_demand"))
    ]
    wheel_1_usable: Annotated[float, Usable(("wheel_speed_1",))]
    wheel_2_usable: Annotated[float, Usable(("wheel_speed_2",))]
    wheel_3_usable: Annotated[float, Usable(("wheel_speed_3",))]
    wheel_4_usable: Annotated[float, Usable(("wheel_speed_4",))]
    torque_usable: Annotated[
        float, Usable(("wheel_torque_1", "wheel_torque_2", "wheel_torque_3", "wheel_torque_4"))
    ]
    acceleration_usable: Annotated[
        float, Usable(("specific_force_x", "specific_force_y", "specific_force_z"))
    ]
    rates_usable: Annotated[float, Usable(("roll_rate", "pitch_rate", "yaw_rate"))]
    slope_usable: Annotated[float, Usable(("pitch", "roll"))]
    pressure_usable: Annotated[float, Usable(("lift_pressure", "tilt_pressure"))]
    # rates that the machine is permitted at present, infinity: any [rad/s]
    rate_limit: float  # of the articulation
    lift_up_limit: float
    lift_down_limit: float
    tilt_back_limit: float
    tilt_forward_limit: float


class Estimates(NamedTuple):
    """What the estimators say about the machine, ISO 8855. A row without a marker stays inside the ECU."""

    normal_1: Annotated[float, Sent("NormalForces", "FrontLeft", "N", "normal", "FrontLeftValid")]
    normal_2: Annotated[float, Sent("NormalForces", "FrontRight", "N", "normal", "FrontRightValid")]
    normal_3: Annotated[float, Sent("NormalForces", "RearLeft", "N", "normal", "RearLeftValid")]
    normal_4: Annotated[float, Sent("NormalForces", "RearRight", "N", "normal", "RearRightValid")]
    # forces of the road on the tyres, in the wheels' own axes
    longitudinal_1: Annotated[float, Sent("TyreForceFrontLeft", "Longitudinal", "N", "force_1", "ForceValid")]
    longitudinal_2: Annotated[
        float, Sent("TyreForceFrontRight", "Longitudinal", "N", "force_2", "ForceValid")
    ]
    longitudinal_3: Annotated[float, Sent("TyreForceRearLeft", "Longitudinal", "N", "force_3", "ForceValid")]
    longitudinal_4: Annotated[float, Sent("TyreForceRearRight", "Longitudinal", "N", "force_4", "ForceValid")]
    lateral_1: Annotated[float, Sent("TyreForceFrontLeft", "Lateral", "N", "force_1", "ForceValid")]
    lateral_2: Annotated[float, Sent("TyreForceFrontRight", "Lateral", "N", "force_2", "ForceValid")]
    lateral_3: Annotated[float, Sent("TyreForceRearLeft", "Lateral", "N", "force_3", "ForceValid")]
    lateral_4: Annotated[float, Sent("TyreForceRearRight", "Lateral", "N", "force_4", "ForceValid")]
    slip_1: Annotated[float, Sent("TyreForceFrontLeft", "Slip", "1", "slip_1", "SlipValid")]
    slip_2: Annotated[float, Sent("TyreForceFrontRight", "Slip", "1", "slip_2", "SlipValid")]
    slip_3: Annotated[float, Sent("TyreForceRearLeft", "Slip", "1", "slip_3", "SlipValid")]
    slip_4: Annotated[float, Sent("TyreForceRearRight", "Slip", "1", "slip_4", "SlipValid")]
    tyre_model_1: float  # longitudinal force of the tyre model at the transient slip [N]
    tyre_model_2: float
    tyre_model_3: float
    tyre_model_4: float
    load_transfer_ratio: Annotated[float, Sent("RollOver", "LoadTransferRatio", "1", "roll_over", "Valid")]
    # of the front pair alone; the others are of all four wheels
    front_load_transfer_ratio: Annotated[
        float, Sent("Warnings", "FrontLoadTransferRatio", "1", "normal", "FrontLoadTransferRatioValid")
    ]
    predicted_load_transfer_ratio: Annotated[
        float, Sent("RollOver", "PredictedLoadTransferRatio", "1", "roll_over", "Valid")
    ]
    lift_off_margin: Annotated[float, Sent("RollOver", "LiftOffMargin", "1", "roll_over", "Valid")]
    lift_off_wheel: float  # the wheel of that margin (1..4)
    predicted_margin: float  # the smallest over the horizon
    time_to_lift_off: Annotated[float, Sent("RollOver", "TimeToLiftOff", "s", "roll_over", "Valid")]
    lifting_wheel: Annotated[float, Sent("RollOver", "LiftingWheel", "1", "roll_over", "Valid")]
    yaw_moment: Annotated[float, Sent("TurningTorque", "YawMoment", "N.m", "yaw_moment", "MomentValid")]
    joint_torque: Annotated[float, Sent("TurningTorque", "JointTorque", "N.m", "joint_torque", "TorqueValid")]
    yaw_rate: Annotated[float, Sent("TurningTorque", "YawRate", "rad/s")]
    speed: Annotated[float, Sent("BodyMotion", "Speed", "m/s", "speed", "SpeedValid")]  # of the rear axle
    # specific force at the machine's centre of gravity
    specific_force_x: Annotated[float, Sent("BodyMotion", "LongitudinalAcceleration", "m/s2")]
    specific_force_y: Annotated[float, Sent("BodyMotion", "LateralAcceleration", "m/s2")]
    specific_force_z: float
    # of the ground under the rear frame, without what accelerations add to the sensor's reading [rad]
    slope_pitch: float
    slope_roll: float
    payload: Annotated[float, Sent("BodyMotion", "PayloadMass", "kg", "payload", "PayloadValid")]
    permitted_rate: float  # articulation rate that leaves a margin [rad/s]
    permitted_direction: float  # ... to the side that the driver demands: +1 left, -1 right, 0 none
    permitted_speed: float  # [m/s]
    permitted_lever: float  # rate of lift arm or bucket that leaves a margin [rad/s]
    permitted_motion: float  # ... in this motion: 0 arm up, 1 arm down, 2 bucket back, 3 bucket forward
    # how far the loads contradict themselves (`ecu.consistency`)
    load_gap: float  # their sum less mass times vertical specific force [N]
    load_contradiction: float  # balance of forces against gyro, as an angle of tilt [rad]
    speed_doubt: float  # by how much the speed may be wrong because wheels slide [m/s]
    # standard deviations by the calibration's tolerances and the sensors' errors (ecu.estimators.uncertainty); 0, not known, in the printed form
    normal_1_sd: Annotated[
        float, Sent("EstimateUncertainty", "NormalForceFrontLeft", "N", deviation_of="normal")
    ]
    normal_2_sd: Annotated[
        float, Sent("EstimateUncertainty", "NormalForceFrontRight", "N", deviation_of="normal")
    ]
    normal_3_sd: Annotated[
        float, Sent("EstimateUncertainty", "NormalForceRearLeft", "N", deviation_of="normal")
    ]
    normal_4_sd: Annotated[
        float, Sent("EstimateUncertainty", "NormalForceRearRight", "N", deviation_of="normal")
    ]
    load_transfer_ratio_sd: Annotated[
        float, Sent("EstimateUncertainty", "LoadTransferRatio", "1", deviation_of="roll_over")
    ]
    payload_sd: Annotated[float, Sent("EstimateUncertainty", "PayloadMass", "kg", deviation_of="payload")]


NEVER = 10.23  # TimeToLiftOff of the DBC: none within the horizon [s]
