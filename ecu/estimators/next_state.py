"""The state that the corrected estimators carry to the next cycle, made from what this cycle found."""

from ecu.estimators.compiled import compiled
from ecu.estimators.inclination import Lean
from ecu.estimators.loads.payload import BucketLoad
from ecu.estimators.motion.arm import Turning
from ecu.estimators.motion.motion import Motion
from ecu.estimators.motion.speed import Fused
from ecu.estimators.quantities import NormalForces, WheelForces
from ecu.estimators.signals import Inputs
from ecu.estimators.stability.levers import MOTIONS
from ecu.estimators.state import State
from ecu.estimators.tyres.contact import Tilt

MOST_CYCLES = 8_000_000.0
"""From here on the counter turns back: single precision counts no further than 2^24, which is 46 h of cycles."""


@compiled
def next_state(
    i: Inputs, s: State, m: Motion, load: BucketLoad, fused: Fused, axle_speed: float, axle_acceleration: float,
    n: NormalForces, f: WheelForces, u: WheelForces, drift: float, tilt: Tilt, bias: Tilt, lean: Lean, front_side: float,
    arm: Turning, bucket: Turning,
) -> State:  # fmt: skip
    """The state for the next cycle."""
    # by whole turns of the levers' four motions, whose limits are looked for one after another
    cycles = s.cycles + 1.0 if s.cycles < MOST_CYCLES else s.cycles + 1.0 - MOTIONS
    return State(
        cycles, load.payload, fused.speed, fused.doubt, i.articulation_rate, m.articulation_acceleration,
        i.roll_rate, m.change.x, i.pitch_rate, m.change.y, i.yaw_rate, m.change.z,
        i.wheel_speed_1, i.wheel_speed_2, i.wheel_speed_3, i.wheel_speed_4,
        m.wheel_acceleration_1, m.wheel_acceleration_2, m.wheel_acceleration_3, m.wheel_acceleration_4,
        n.front_left, n.front_right, n.rear_left, n.rear_right,
        f.x1, f.x2, f.x3, f.x4, u.x1, u.x2, u.x3, u.x4, drift, axle_speed, axle_acceleration,
        tilt.roll, tilt.pitch, bias.roll, bias.pitch, lean.pitch, lean.roll, lean.speed, front_side,
        arm.angle, arm.rate, arm.acceleration, arm.sample,
        bucket.angle, bucket.rate, bucket.acceleration, bucket.sample,
        load.couple, load.calm_payload, load.calm_couple, load.digging, load.x, load.z, load.traction,
    )  # fmt: skip
