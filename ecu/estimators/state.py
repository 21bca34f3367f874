"""What is carried from one cycle to the next."""

from ecu.estimators.compiled import compiled
from ecu.estimators.contact import Tilt
from ecu.estimators.motion import Motion
from ecu.estimators.normal_force import NormalForces
from ecu.estimators.payload import BucketLoad
from ecu.estimators.signals import Inputs, State
from ecu.estimators.turning import WheelForces


@compiled
def next_state(
    i: Inputs, s: State, m: Motion, load: BucketLoad, fused: float, axle_speed: float, axle_acceleration: float,
    n: NormalForces, f: WheelForces, u: WheelForces, drift: float, tilt: Tilt, bias: Tilt,
) -> State:  # fmt: skip
    """The state for the next cycle."""
    return State(
        s.cycles + 1.0, load.payload, fused, i.articulation_rate, m.articulation_acceleration,
        i.roll_rate, m.change.x, i.pitch_rate, m.change.y, i.yaw_rate, m.change.z,
        i.wheel_speed_1, i.wheel_speed_2, i.wheel_speed_3, i.wheel_speed_4,
        m.wheel_acceleration_1, m.wheel_acceleration_2, m.wheel_acceleration_3, m.wheel_acceleration_4,
        n.front_left, n.front_right, n.rear_left, n.rear_right,
        f.x1, f.x2, f.x3, f.x4, u.x1, u.x2, u.x3, u.x4, drift, axle_speed, axle_acceleration,
        tilt.roll, tilt.pitch, bias.roll, bias.pitch,
        load.couple, load.calm_payload, load.calm_couple, load.digging, load.x, load.z, load.traction,
    )  # fmt: skip
