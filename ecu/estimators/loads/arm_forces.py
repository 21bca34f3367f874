"""Forces that a moving arm and bucket put on the front frame beside those of the rigid machine.

Each lump (arm, bucket, payload) has, relative to the front frame, a tangential and a centripetal acceleration, and in
a turn that of Coriolis. Their sums and moments about the joint on the ground enter the balance of forces.
Left out: Coriolis accelerations from roll and pitch rates, a tenth of those from yaw.
"""

from typing import NamedTuple

from ecu.estimators.compiled import compiled, inlined
from ecu.estimators.loads.cog import Pose
from ecu.estimators.motion.arm import Turning, moving
from ecu.estimators.parameters import Arm, Bucket


class ArmForces(NamedTuple):
    """Sum of mass times relative acceleration over the lumps, and its moments about the joint; front axes."""

    x: float  # [N]
    y: float
    z: float
    pitching: float  # x a_z - z a_x, and the lumps' spin [N m]
    rolling: float  # - z a_y [N m]
    yawing: float  # x a_y [N m]


NO_ARM_FORCES = ArmForces(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Arm and bucket stand still."""


class Relative(NamedTuple):
    """Velocity and acceleration of a point that turns about another [m/s, m/s2]."""

    vx: float
    ax: float
    az: float


@inlined
def relative(x: float, z: float, rate: float, acceleration: float) -> Relative:
    """Motion of the point (x, z) [m] away from the pin of a part that turns upwards."""
    return Relative(-rate * z, -acceleration * z - rate * rate * x, acceleration * x - rate * rate * z)


@inlined
def lump(mass: float, x: float, z: float, spin: float, motion: Relative, yaw_rate: float) -> ArmForces:
    """Share of one lump at (x, z) [m] from the joint; spin: moment of inertia times angular acceleration [N m]."""
    across = 2.0 * yaw_rate * motion.vx
    return ArmForces(
        mass * motion.ax,
        mass * across,
        mass * motion.az,
        mass * (x * motion.az - z * motion.ax) + spin,
        -mass * z * across,
        mass * x * across,
    )


@compiled
def arm_forces(
    pose: Pose, lift: Turning, tilt: Turning, yaw_rate: float, payload: float, arm: Arm, bucket: Bucket
) -> ArmForces:
    """Forces of the lumps in this pose while one of them moves; yaw_rate: of the front frame [rad/s]; payload [kg]."""
    if not (moving(lift) or moving(tilt)):
        return NO_ARM_FORCES
    ax, az, px, pz = pose.arm_x, pose.arm_z, pose.pin_x, pose.pin_z
    bx, bz, lx, lz = pose.bucket_x, pose.bucket_z, pose.load_x, pose.load_z
    pin = relative(px, pz, lift.rate, lift.acceleration)
    of_bucket = relative(bx, bz, tilt.rate, tilt.acceleration)
    of_load = relative(lx, lz, tilt.rate, tilt.acceleration)
    gyration = bucket.payload_pitch_gyration
    a = lump(
        arm.mass, arm.pivot_x + ax, arm.pivot_z + az, arm.pitch_inertia * lift.acceleration,
        relative(ax, az, lift.rate, lift.acceleration), yaw_rate,
    )  # fmt: skip
    b = lump(
        bucket.mass, arm.pivot_x + px + bx, arm.pivot_z + pz + bz, bucket.pitch_inertia * tilt.acceleration,
        Relative(pin.vx + of_bucket.vx, pin.ax + of_bucket.ax, pin.az + of_bucket.az), yaw_rate,
    )  # fmt: skip
    c = lump(
        payload, arm.pivot_x + px + lx, arm.pivot_z + pz + lz, payload * gyration * gyration * tilt.acceleration,
        Relative(pin.vx + of_load.vx, pin.ax + of_load.ax, pin.az + of_load.az), yaw_rate,
    )  # fmt: skip
    return ArmForces(
        a.x + b.x + c.x,
        a.y + b.y + c.y,
        a.z + b.z + c.z,
        a.pitching + b.pitching + c.pitching,
        a.rolling + b.rolling + c.rolling,
        a.yawing + b.yawing + c.yawing,
    )
