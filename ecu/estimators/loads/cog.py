"""Centre of gravity of the front unit and of the whole machine (thesis 2.4.2).

Origin: the articulation joint on the ground, axes of the rear frame. Corrections: E-09 to E-12 of
the errata (signs of the lateral distances, moment of the rear body, rotation about the real pivot).
"""

import math

from ecu.estimators.compiled import compiled
from ecu.estimators.parameters import Arm, Axle, Body, Bucket, Geometry
from ecu.estimators.quantities import Centre


@compiled
def rotated(x: float, z: float, angle: float) -> tuple[float, float]:
    """(x, z) turned up by `angle` [rad] in the vertical plane."""
    c, s = math.cos(angle), math.sin(angle)
    return x * c - z * s, x * s + z * c


@compiled
def front_unit(
    lift_arm_angle: float, tilt_angle: float, payload: float, frame: Body, arm: Arm, bucket: Bucket
) -> Body:
    """The front frame with arm, bucket and payload as one lump, in the axes of the front frame.

    lift_arm_angle, tilt_angle [rad] above the front frame's horizontal; payload [kg].
    (37), (42) with the full rotation about the arm's pivot (E-11, E-12).
    """
    ax, az = rotated(arm.along, arm.above, lift_arm_angle)
    ax, az = arm.pivot_x + ax, arm.pivot_z + az
    px, pz = rotated(arm.length, 0.0, lift_arm_angle)
    px, pz = arm.pivot_x + px, arm.pivot_z + pz
    bx, bz = rotated(bucket.forward, bucket.above, tilt_angle - bucket.carried)
    bx, bz = px + bx, pz + bz
    lx, lz = rotated(bucket.payload_forward, bucket.payload_above, tilt_angle - bucket.carried)
    lx, lz = px + lx, pz + lz

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
