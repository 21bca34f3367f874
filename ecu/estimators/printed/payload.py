"""Payload of a machine that stands level, from the pressures of lift and tilt cylinders.

The thesis takes the payload as known and has no equation for it. This is the balance of moments at rest: about the
arm's pivot less about the bucket's pin. Levers are derivatives of the cylinders' lengths by the angle (virtual work),
here by central differences.
"""

import math

from ecu.estimators.compiled import compiled
from ecu.estimators.parameters import GRAVITY, Arm, Bucket, Cylinders, Parameters, TiltLinkage
from ecu.estimators.signals import Inputs

STEP = 1e-4
"""Half the difference of angle [rad]: the lever's error is below 1e-7 m."""


@compiled
def turned_up(x: float, z: float, angle: float) -> tuple[float, float]:
    """(x, z) turned up by `angle` [rad] in the vertical plane."""
    c, s = math.cos(angle), math.sin(angle)
    return x * c - z * s, x * s + z * c


@compiled
def lift_cylinder_length(arm_angle: float, arm: Arm, c: Cylinders) -> float:
    """Length of the lift cylinders between their pins [m]."""
    x, z = turned_up(c.pin_along, c.pin_above, arm_angle)
    x += arm.pivot_x - c.base_x
    z += arm.pivot_z - c.base_z
    return math.sqrt(x * x + z * z)


@compiled
def tilt_cylinder_length(
    arm_angle: float, tilt_angle: float, arm: Arm, bucket: Bucket, t: TiltLinkage
) -> float:
    """Length of the tilt cylinder between its pins [m], through bell crank and link."""
    cx, cz = turned_up(t.crank_along, t.crank_above, arm_angle)
    px, pz = turned_up(arm.length, 0.0, arm_angle)
    bx, bz = turned_up(t.pin_forward, t.pin_above, tilt_angle - bucket.carried)
    dx, dz = px + bx - cx, pz + bz - cz
    away = math.sqrt(dx * dx + dz * dz)
    cosine = (t.link_arm * t.link_arm + away * away - t.link * t.link) / (2.0 * t.link_arm * away)
    at = math.atan2(dz, dx) - math.acos(min(max(cosine, -1.0), 1.0)) + t.between
    x = arm.pivot_x + cx + t.cylinder_arm * math.cos(at) - t.base_x
    z = arm.pivot_z + cz + t.cylinder_arm * math.sin(at) - t.base_z
    return math.sqrt(x * x + z * z)


@compiled
def standing_payload(i: Inputs, p: Parameters) -> float:
    """Payload [kg] of a machine that stands on level ground."""
    arm, bucket, cylinders, t = p.arm, p.bucket, p.cylinders, p.tilt_linkage
    down, up = i.lift_arm_angle - STEP, i.lift_arm_angle + STEP
    lift = lift_cylinder_length(up, arm, cylinders) - lift_cylinder_length(down, arm, cylinders)
    back = tilt_cylinder_length(i.lift_arm_angle, i.tilt_angle + STEP, arm, bucket, t)
    forth = tilt_cylinder_length(i.lift_arm_angle, i.tilt_angle - STEP, arm, bucket, t)
    with_arm = tilt_cylinder_length(up, i.tilt_angle + STEP, arm, bucket, t)  # arm and bucket turn as one
    against = tilt_cylinder_length(down, i.tilt_angle - STEP, arm, bucket, t)
    tilt_lever = (with_arm - against) / (2.0 * STEP) - (back - forth) / (2.0 * STEP)
    lifting = i.lift_pressure * cylinders.head_area - cylinders.back_pressure * cylinders.rod_area
    tilting = i.tilt_pressure * t.head_area - t.back_pressure * t.rod_area
    ax, _ = turned_up(arm.along, arm.above, i.lift_arm_angle)
    px, _ = turned_up(arm.length, 0.0, i.lift_arm_angle)
    own = arm.mass * (ax * GRAVITY) + bucket.mass * (px * GRAVITY)
    return (lifting * (lift / (2.0 * STEP)) + tilting * tilt_lever - own) / (px * GRAVITY)
