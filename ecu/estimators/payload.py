"""Payload from the pressure of the lift cylinders.

Balance of moments about the arm's pivot, of arm, bucket and payload together. The tilt cylinder sits
on the arm here, so that its force is internal. Holds while the bucket does not touch the ground and
the arm moves evenly.
"""

import math

from ecu.estimators.cog import rotated
from ecu.estimators.compiled import compiled
from ecu.estimators.parameters import Arm, Bucket, Cylinders


@compiled
def lift_lever(lift_arm_angle: float, arm: Arm, cylinders: Cylinders) -> float:
    """Lever of the lift cylinders about the arm's pivot [m], raising +."""
    px, pz = rotated(cylinders.pin_along, cylinders.pin_above, lift_arm_angle)
    bx, bz = cylinders.base_x - arm.pivot_x, cylinders.base_z - arm.pivot_z
    dx, dz = px - bx, pz - bz
    return (px * dz - pz * dx) / math.sqrt(dx * dx + dz * dz)


@compiled
def payload(
    lift_pressure: float,
    lift_arm_angle: float,
    tilt_angle: float,
    fx: float,
    fz: float,
    arm: Arm,
    bucket: Bucket,
    cylinders: Cylinders,
) -> float:
    """Payload [kg] that balances the lift pressure [Pa, head side, gauge].

    fx, fz: specific force of the front unit along its own axes [m/s2].
    """
    ax, az = rotated(arm.along, arm.above, lift_arm_angle)
    px, pz = rotated(arm.length, 0.0, lift_arm_angle)
    bx, bz = rotated(bucket.forward, bucket.above, tilt_angle - bucket.carried)
    lx, lz = rotated(bucket.payload_forward, bucket.payload_above, tilt_angle - bucket.carried)
    push = lift_pressure * cylinders.head_area - cylinders.back_pressure * cylinders.rod_area
    raising = push * lift_lever(lift_arm_angle, arm, cylinders)
    own = arm.mass * (ax * fz - az * fx) + bucket.mass * ((px + bx) * fz - (pz + bz) * fx)
    return (raising - own) / ((px + lx) * fz - (pz + lz) * fx)
