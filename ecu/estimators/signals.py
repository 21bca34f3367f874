"""What goes into one cycle of the estimators, what comes out, and what they carry to the next.

Everything here is a float: flags are 0 or 1, wheels are 1 FL, 2 FR, 3 RL, 4 RR. An input that is not
usable still needs a number (its last one); its flag says that it is not to be relied on, and what can
do without it does. Which estimate may then be called valid is decided in `ecu.validity`.
"""

from typing import NamedTuple


class Inputs(NamedTuple):
    """What the machine reports, SI, and which of it is usable (1) or not (0)."""

    dt: float  # time since the previous cycle [s]
    articulation_angle: float
    articulation_rate: float
    articulation_rate_demand: float
    wheel_speed_1: float
    wheel_speed_2: float
    wheel_speed_3: float
    wheel_speed_4: float
    wheel_torque_1: float
    wheel_torque_2: float
    wheel_torque_3: float
    wheel_torque_4: float
    specific_force_x: float
    specific_force_y: float
    specific_force_z: float
    roll_rate: float
    pitch_rate: float
    yaw_rate: float
    pitch: float
    roll: float
    lift_pressure: float
    tilt_pressure: float
    lift_arm_angle: float
    tilt_angle: float
    demand_usable: float
    wheel_1_usable: float
    wheel_2_usable: float
    wheel_3_usable: float
    wheel_4_usable: float
    torque_usable: float
    acceleration_usable: float
    rates_usable: float
    slope_usable: float
    pressure_usable: float
    rate_limit: float  # articulation rate the machine is permitted at present [rad/s]


class State(NamedTuple):
    """What the estimators carry from cycle to cycle; `INITIAL` before the first."""

    cycles: float  # since the start
    payload: float
    speed: float
    articulation_rate: float
    articulation_acceleration: float
    roll_rate: float
    roll_acceleration: float
    pitch_rate: float
    pitch_acceleration: float
    yaw_rate: float
    yaw_acceleration: float
    wheel_speed_1: float
    wheel_speed_2: float
    wheel_speed_3: float
    wheel_speed_4: float
    wheel_acceleration_1: float
    wheel_acceleration_2: float
    wheel_acceleration_3: float
    wheel_acceleration_4: float
    normal_1: float
    normal_2: float
    normal_3: float
    normal_4: float
    force_1: float
    force_2: float
    force_3: float
    force_4: float
    deflection_1: float
    deflection_2: float
    deflection_3: float
    deflection_4: float
    drift: float
    axle_speed: float
    axle_acceleration: float
    roll_tilt: float
    pitch_tilt: float
    roll_bias: float
    pitch_bias: float
    couple: float  # of the load on the bucket (ecu.estimators.payload)
    calm_payload: float
    calm_couple: float
    digging: float
    push_x: float
    push_z: float
    traction: float


INITIAL = State(*([0.0] * len(State._fields)))


class Estimates(NamedTuple):
    """What the ECU tells about the machine, SI, ISO 8855."""

    normal_1: float
    normal_2: float
    normal_3: float
    normal_4: float
    longitudinal_1: float
    longitudinal_2: float
    longitudinal_3: float
    longitudinal_4: float
    lateral_1: float
    lateral_2: float
    lateral_3: float
    lateral_4: float
    slip_1: float
    slip_2: float
    slip_3: float
    slip_4: float
    tyre_model_1: float  # longitudinal force of the tyre model at the transient slip [N]
    tyre_model_2: float
    tyre_model_3: float
    tyre_model_4: float
    load_transfer_ratio: float
    predicted_load_transfer_ratio: float
    lift_off_margin: float
    lift_off_wheel: float
    predicted_margin: float
    time_to_lift_off: float
    lifting_wheel: float
    yaw_moment: float
    joint_torque: float
    yaw_rate: float
    speed: float
    specific_force_x: float  # at the machine's centre of gravity
    specific_force_y: float
    specific_force_z: float
    payload: float
    permitted_rate: float
    permitted_speed: float
