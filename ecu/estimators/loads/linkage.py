"""Forces of the cylinders of arm and bucket, and their levers about the arm's pivot and the bucket's pin.

Lift cylinders between front frame and arm; a tilt cylinder from the front frame to a bell crank on the arm, whose link
turns the bucket. A lever is the derivative of a cylinder's length by the angle (virtual work), in closed form: single
precision leaves three digits of a difference of lengths. Holds at rest and while the arm moves evenly.
"""

import math
from typing import NamedTuple

from ecu.estimators.compiled import compiled
from ecu.estimators.loads.cog import rotated
from ecu.estimators.parameters import Arm, Bucket, Cylinders, TiltLinkage

LEAST_SINE = 1e-3
"""Of the angle between crank and link, where both stand in line and the lever grows without bound."""


class Levers(NamedTuple):
    """Moment per newton of a cylinder's push [m], up and rolling back positive."""

    lift: float  # of the lift cylinders about the arm's pivot
    tilt_on_arm: float  # of the tilt cylinder about the arm's pivot
    tilt_on_bucket: float  # of the tilt cylinder about the bucket's pin


@compiled
def lift_lever(arm_angle: float, arm: Arm, c: Cylinders) -> float:
    """Lever of the lift cylinders about the arm's pivot [m]: change of their length by the arm's angle."""
    x, z = rotated(c.pin_along, c.pin_above, arm_angle)
    base_x, base_z = arm.pivot_x - c.base_x, arm.pivot_z - c.base_z
    dx, dz = base_x + x, base_z + z
    return (base_z * x - base_x * z) / math.sqrt(dx * dx + dz * dz)


@compiled
def tilt_lever(
    arm_angle: float, tilt_angle: float, arm_turns: float, arm: Arm, bucket: Bucket, t: TiltLinkage
) -> float:
    """Change of the tilt cylinder's length by the bucket's angle [m]; arm_turns: 1 while the arm turns with it, else 0."""
    cx, cz = rotated(t.crank_along, t.crank_above, arm_angle)
    px, pz = rotated(arm.length, 0.0, arm_angle)
    bx, bz = rotated(t.pin_forward, t.pin_above, tilt_angle - bucket.carried)
    # from the crank's pivot to the link's pin on the bucket, and how that changes
    dx, dz = px + bx - cx, pz + bz - cz
    ddx, ddz = -arm_turns * (pz - cz) - bz, arm_turns * (px - cx) + bx
    square = dx * dx + dz * dz
    away = math.sqrt(square)
    cosine = (t.link_arm * t.link_arm + square - t.link * t.link) / (2.0 * t.link_arm * away)
    cosine = min(max(cosine, -1.0), 1.0)
    at = math.atan2(dz, dx) - math.acos(cosine) + t.between
    bent = (square - t.link_arm * t.link_arm + t.link * t.link) / (2.0 * t.link_arm * square)
    bent *= (dx * ddx + dz * ddz) / away
    sine = math.sqrt(max(1.0 - cosine * cosine, LEAST_SINE * LEAST_SINE))
    turned = (dx * ddz - dz * ddx) / square + bent / sine
    ax, az = t.cylinder_arm * math.cos(at), t.cylinder_arm * math.sin(at)
    x, z = arm.pivot_x + cx + ax - t.base_x, arm.pivot_z + cz + az - t.base_z
    moved_x, moved_z = -arm_turns * cz - turned * az, arm_turns * cx + turned * ax
    return (x * moved_x + z * moved_z) / math.sqrt(x * x + z * z)


@compiled
def levers(
    arm_angle: float, tilt_angle: float, arm: Arm, bucket: Bucket, cylinders: Cylinders, t: TiltLinkage
) -> Levers:
    """Levers of the cylinders; angles above the front frame's horizontal [rad]."""
    return Levers(
        lift_lever(arm_angle, arm, cylinders),
        tilt_lever(arm_angle, tilt_angle, 1.0, arm, bucket, t),
        tilt_lever(arm_angle, tilt_angle, 0.0, arm, bucket, t),
    )


@compiled
def pushes(
    lift_pressure: float, tilt_pressure: float, cylinders: Cylinders, t: TiltLinkage
) -> tuple[float, float]:
    """Force of the lift and of the tilt cylinders [N] for their head-side pressures [Pa, gauge]."""
    return (
        lift_pressure * cylinders.head_area - cylinders.back_pressure * cylinders.rod_area,
        tilt_pressure * t.head_area - t.back_pressure * t.rod_area,
    )
