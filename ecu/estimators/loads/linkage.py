"""Forces of the cylinders of arm and bucket, and their levers about the arm's pivot and the bucket's pin.

Lift cylinders between front frame and arm; a tilt cylinder from the front frame to a bell crank on the arm, whose link
turns the bucket. A lever is the derivative of a cylinder's length by the angle (virtual work), here by central
differences: lengths are all that has to be known. Holds at rest and while the arm moves evenly.
"""

import math
from typing import NamedTuple

from ecu.estimators.compiled import compiled
from ecu.estimators.loads.cog import rotated
from ecu.estimators.parameters import Arm, Bucket, Cylinders, TiltLinkage

STEP = 1e-4
"""Half the difference of angle [rad]: the lever's error is below 1e-7 m."""


class Levers(NamedTuple):
    """Moment per newton of a cylinder's push [m], up and rolling back positive."""

    lift: float  # of the lift cylinders about the arm's pivot
    tilt_on_arm: float  # of the tilt cylinder about the arm's pivot
    tilt_on_bucket: float  # of the tilt cylinder about the bucket's pin


@compiled
def lift_length(arm_angle: float, arm: Arm, c: Cylinders) -> float:
    """Length of the lift cylinders between their pins [m]."""
    x, z = rotated(c.pin_along, c.pin_above, arm_angle)
    x += arm.pivot_x - c.base_x
    z += arm.pivot_z - c.base_z
    return math.sqrt(x * x + z * z)


@compiled
def tilt_length(arm_angle: float, tilt_angle: float, arm: Arm, bucket: Bucket, t: TiltLinkage) -> float:
    """Length of the tilt cylinder between its pins [m]."""
    cx, cz = rotated(t.crank_along, t.crank_above, arm_angle)
    px, pz = rotated(arm.length, 0.0, arm_angle)
    bx, bz = rotated(t.pin_forward, t.pin_above, tilt_angle - bucket.carried)
    dx, dz = px + bx - cx, pz + bz - cz
    away = math.sqrt(dx * dx + dz * dz)
    cosine = (t.link_arm * t.link_arm + away * away - t.link * t.link) / (2.0 * t.link_arm * away)
    at = math.atan2(dz, dx) - math.acos(min(max(cosine, -1.0), 1.0)) + t.between
    x = arm.pivot_x + cx + t.cylinder_arm * math.cos(at) - t.base_x
    z = arm.pivot_z + cz + t.cylinder_arm * math.sin(at) - t.base_z
    return math.sqrt(x * x + z * z)


@compiled
def levers(
    arm_angle: float, tilt_angle: float, arm: Arm, bucket: Bucket, cylinders: Cylinders, t: TiltLinkage
) -> Levers:
    """Levers of the cylinders; angles above the front frame's horizontal [rad]."""
    down, up = arm_angle - STEP, arm_angle + STEP
    lift = lift_length(up, arm, cylinders) - lift_length(down, arm, cylinders)
    back = tilt_length(arm_angle, tilt_angle + STEP, arm, bucket, t)
    forth = tilt_length(arm_angle, tilt_angle - STEP, arm, bucket, t)
    with_arm = tilt_length(up, tilt_angle + STEP, arm, bucket, t)  # arm and bucket turn as one
    against = tilt_length(down, tilt_angle - STEP, arm, bucket, t)
    return Levers(lift / (2.0 * STEP), (with_arm - against) / (2.0 * STEP), (back - forth) / (2.0 * STEP))


@compiled
def pushes(
    lift_pressure: float, tilt_pressure: float, cylinders: Cylinders, t: TiltLinkage
) -> tuple[float, float]:
    """Force of the lift and of the tilt cylinders [N] for their head-side pressures [Pa, gauge]."""
    return (
        lift_pressure * cylinders.head_area - cylinders.back_pressure * cylinders.rod_area,
        tilt_pressure * t.head_area - t.back_pressure * t.rod_area,
    )
