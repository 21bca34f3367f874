"""What the corrected estimators carry from cycle to cycle."""

from typing import NamedTuple


class State(NamedTuple):
    """Everything the next cycle needs of this one; `INITIAL` before the first.

    Rates are the last samples, accelerations their filtered derivatives. Wheels are 1 FL, 2 FR, 3 RL, 4 RR.
    """

    cycles: float  # since the start
    payload: float  # [kg]
    speed: float  # of the rear axle, fused [m/s]
    speed_doubt: float  # by how much it may be wrong because wheels slide [m/s]
    articulation_rate: float  # [rad/s]
    articulation_acceleration: float  # [rad/s2]
    roll_rate: float  # of the rear frame [rad/s]
    roll_acceleration: float  # [rad/s2]
    pitch_rate: float
    pitch_acceleration: float
    yaw_rate: float
    yaw_acceleration: float
    wheel_speed_1: float  # [rad/s]
    wheel_speed_2: float
    wheel_speed_3: float
    wheel_speed_4: float
    wheel_acceleration_1: float  # [rad/s2]
    wheel_acceleration_2: float
    wheel_acceleration_3: float
    wheel_acceleration_4: float
    normal_1: float  # normal force [N]
    normal_2: float
    normal_3: float
    normal_4: float
    force_1: float  # longitudinal force [N]
    force_2: float
    force_3: float
    force_4: float
    deflection_1: float  # of the contact point of the tyre model [m]
    deflection_2: float
    deflection_3: float
    deflection_4: float
    drift: float  # velocity of the joint to the left [m/s]
    axle_speed: float  # of the rear axle by the wheels alone [m/s]
    axle_acceleration: float  # [m/s2]
    roll_tilt: float  # of the rear frame against the road [rad]
    pitch_tilt: float
    roll_bias: float  # of the gyro [rad/s]
    pitch_bias: float
    pitch_lean: (
        float  # what accelerations add to the inclination sensor's reading (ecu.estimators.inclination) [rad]
    )
    roll_lean: float
    lean_speed: float  # of the rear axle, as that correction has it [m/s]
    front_side: float  # lateral force of the front axle [N]
    lift_angle: float  # of the lift arm, tracked (ecu.estimators.motion.arm) [rad]
    lift_rate: float  # [rad/s]
    lift_acceleration: float  # [rad/s2]
    lift_sample: float  # [rad]
    tilt_angle: float  # of the bucket, likewise
    tilt_rate: float
    tilt_acceleration: float
    tilt_sample: float
    # of the load on the bucket: the fields of ecu.estimators.loads.payload.BucketLoad
    couple: float  # [N m]
    calm_payload: float  # [kg]
    calm_couple: float
    digging: float
    push_x: float  # [N]
    push_z: float
    traction: float  # [N]


INITIAL = State(*([0.0] * len(State._fields)))
