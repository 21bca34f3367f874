"""Centre of gravity of the front unit and of the whole machine (thesis 2.4.2).

Origin: the articulation joint on the ground, axes of the rear frame. Corrections: E-09 to E-12 of
the errata (signs of the lateral distances, moment of the rear body, rotation about the real pivot).
"""

import math
from typing import NamedTuple

from ecu.estimators.compiled import compiled
from ecu.estimators.joint import Joint, joint_at
from ecu.estimators.parameters import Arm, Axle, Body, Bucket, Geometry
from ecu.estimators.quantities import Centre


@compiled
def rotated(x: float, z: float, angle: float) -> tuple[float, float]:
    """(x, z) turned up by `angle` [rad] in the vertical plane."""
    c, s = math.cos(angle), math.sin(angle)
    return x * c - z * s, x * s + z * c


class Pose(NamedTuple):
    """Where arm and bucket hold their masses, in the axes of the front frame [m]."""

    arm_x: float  # centre of gravity of the arm, from its pivot
    arm_z: float
    pin_x: float  # the bucket's pin, from the arm's pivot
    pin_z: float
    bucket_x: float  # centre of gravity of the bucket, from its pin
    bucket_z: float
    load_x: float  # that of the payload, from the bucket's pin
    load_z: float


@compiled
def pose_at(lift_arm_angle: float, tilt_angle: float, arm: Arm, bucket: Bucket) -> Pose:
    """The pose at these angles [rad] above the front frame's horizontal."""
    return pose_of(joint_at(lift_arm_angle), joint_at(tilt_angle - bucket.carried), arm, bucket)


@compiled
def pose_of(pivot: Joint, pin: Joint, arm: Arm, bucket: Bucket) -> Pose:
    """The pose with the full rotation about the arm's pivot (E-11, E-12); pin: of the bucket, 0 where it is carried."""
    c, s, tc, ts = pivot.cosine, pivot.sine, pin.cosine, pin.sine
    return Pose(
        arm.along * c - arm.above * s,
        arm.along * s + arm.above * c,
        arm.length * c,
        arm.length * s,
        bucket.forward * tc - bucket.above * ts,
        bucket.forward * ts + bucket.above * tc,
        bucket.payload_forward * tc - bucket.payload_above * ts,
        bucket.payload_forward * ts + bucket.payload_above * tc,
    )


@compiled
def front_unit(
    lift_arm_angle: float, tilt_angle: float, payload: float, frame: Body, arm: Arm, bucket: Bucket
) -> Body:
    """The front frame with arm, bucket and payload as one lump at these angles [rad]; otherwise as `front_unit_in`."""
    return front_unit_in(pose_at(lift_arm_angle, tilt_angle, arm, bucket), payload, frame, arm, bucket)


@compiled
def front_unit_in(pose: Pose, payload: float, frame: Body, arm: Arm, bucket: Bucket) -> Body:
    """The front frame with arm, bucket and payload [kg] as one lump, in the axes of the front frame: (37), (42)."""
    ax, az = arm.pivot_x + pose.arm_x, arm.pivot_z + pose.arm_z
    px, pz = arm.pivot_x + pose.pin_x, arm.pivot_z + pose.pin_z
    bx, bz = px + pose.bucket_x, pz + pose.bucket_z
    lx, lz = px + pose.load_x, pz + pose.load_z

    mass = frame.mass + arm.mass + bucket.mass + payload
    x = (frame.mass * frame.x + arm.mass * ax + bucket.mass * bx + payload * lx) / mass
    z = (frame.mass * frame.z + arm.mass * az + bucket.mass * bz + payload * lz) / mass
    fx, ax, bx, lx = frame.x - x, ax - x, bx - x, lx - x
    fz, az, bz, lz = frame.z - z, az - z, bz - z, lz - z
    about_z = frame.mass * fx * fx + arm.mass * ax * ax + bucket.mass * bx * bx + payload * lx * lx
    about_x = frame.mass * fz * fz + arm.mass * az * az + bucket.mass * bz * bz + payload * lz * lz
    kx, ky, kz = bucket.payload_roll_gyration, bucket.payload_pitch_gyration, bucket.payload_yaw_gyration
    return Body(
        mass,
        x,
        z,
        frame.roll_inertia + arm.roll_inertia + bucket.roll_inertia + payload * kx * kx + about_x,
        frame.pitch_inertia
        + arm.pitch_inertia
        + bucket.pitch_inertia
        + payload * ky * ky
        + about_x
        + about_z,
        frame.yaw_inertia + arm.yaw_inertia + bucket.yaw_inertia + payload * kz * kz + about_z,
    )


@compiled
def product_of_inertia(
    pose: Pose, payload: float, front: Body, frame: Body, arm: Arm, bucket: Bucket
) -> float:
    """Sum of mass times distance ahead of and above the front unit's centre of gravity [kg m2]; front: of `front_unit_in`."""
    px, pz = arm.pivot_x + pose.pin_x, arm.pivot_z + pose.pin_z
    product = frame.mass * frame.x * frame.z
    product += arm.mass * (arm.pivot_x + pose.arm_x) * (arm.pivot_z + pose.arm_z)
    product += bucket.mass * (px + pose.bucket_x) * (pz + pose.bucket_z)
    product += payload * (px + pose.load_x) * (pz + pose.load_z)
    return product - front.mass * front.x * front.z


@compiled
def machine_centre(articulation_angle: float, front: Body, rear: Body) -> Centre:
    """Centre of gravity of front and rear unit together, (36), (40), (41) corrected (E-09, E-10)."""
    mass = front.mass + rear.mass
    x = (front.mass * front.x * math.cos(articulation_angle) + rear.mass * rear.x) / mass
    y = front.mass * front.x * math.sin(articulation_angle) / mass
    z = (front.mass * front.z + rear.mass * rear.z) / mass
    return Centre(mass, x, y, z)


@compiled
def with_axle(rear: Body, axle: Axle, geometry: Geometry) -> Body:
    """The rear unit with its axle as one lump; yaw inertia by the parallel axis theorem."""
    mass = rear.mass + axle.mass
    x = (rear.mass * rear.x - axle.mass * geometry.rear_length) / mass
    z = (rear.mass * rear.z + axle.mass * axle.height) / mass
    between = rear.x + geometry.rear_length
    yaw = rear.yaw_inertia + axle.roll_inertia + rear.mass * axle.mass / mass * between * between
    return Body(mass, x, z, rear.roll_inertia + axle.roll_inertia, rear.pitch_inertia, yaw)
