"""The linkage of the working equipment: lift and tilt cylinders between their pins, and their pressures.

Lift: cylinders from the front frame to the arm. Tilt: a Z-bar. A cylinder from the front frame turns a bell crank on the
arm, a link from the crank's other end turns the bucket about its pin; extension rolls the bucket back. Therefore the tilt
cylinder carries a part of the arm. Angles are up from the front frame's horizontal, points from the arm's pivot.
Left out: masses of crank and link of their own, friction of pins and seals, pressure loss in the lines.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plant.compiled import uncounted
from plant.sheets.machine import Lift, Tilt

Array = NDArray[np.float64]

# Layout of what the functions below need of a machine: points from the arm's pivot [m], areas [m2], pressures [Pa].
K_LIFT_BASE: Final = 0  # x, z of the lift cylinders' pin on the front frame
K_LIFT_PIN: Final = 2  # along and above the arm
K_TILT_BASE: Final = 4  # x, z of the tilt cylinder's pin on the front frame
K_CRANK: Final = 6  # along and above the arm: pivot of the bell crank
K_CYLINDER_ARM: Final = 8  # of the crank, to the cylinder
K_LINK_ARM: Final = 9  # of the crank, to the link
K_BETWEEN: Final = 10  # angle from the link's arm to the cylinder's, upwards [rad]
K_LINK: Final = 11  # length
K_BUCKET: Final = 12  # x, z of the link's pin from the bucket's pin, as carried
K_ARM_LENGTH: Final = 14
K_CARRY: Final = 15  # tilt angle as carried [rad]
K_LIFT_HEAD: Final = 16  # of all cylinders together
K_LIFT_ROD: Final = 17  # rod side
K_LIFT_BACK: Final = 18  # pressure of the rod side
K_TILT_HEAD: Final = 19
K_TILT_ROD: Final = 20
K_TILT_BACK: Final = 21
LINKAGE: Final = 22


def linkage_of(lift: Lift, tilt: Tilt) -> Array:
    """The linkage of a machine, (LINKAGE,)."""
    head, rod = _areas(lift.cylinder_count, lift.bore, lift.rod)
    tilt_head, tilt_rod = _areas(tilt.cylinder_count, tilt.bore, tilt.rod)
    return np.array(
        (
            *(lift.base_x - lift.pivot_x, lift.base_z - lift.pivot_z, lift.rod_pin_along, lift.rod_pin_above),
            *(tilt.base_x - lift.pivot_x, tilt.base_z - lift.pivot_z, tilt.crank_along, tilt.crank_above),
            *(tilt.crank_cylinder_arm, tilt.crank_link_arm, tilt.crank_angle, tilt.link_length),
            *(tilt.bucket_pin_x, tilt.bucket_pin_z, lift.arm_length, tilt.carry_angle),
            *(head, rod, lift.back_pressure, tilt_head, tilt_rod, tilt.back_pressure),
        )
    )


def _areas(count: float, bore: float, rod: float) -> tuple[float, float]:
    """Head-side and rod-side area of all cylinders together [m²]."""
    head = count * math.pi / 4.0 * bore**2
    return head, head - count * math.pi / 4.0 * rod**2


@uncounted
def lift_cylinder(k: Array, angle: float) -> tuple[float, float]:
    """Length of the lift cylinders [m] and their moment arm about the arm's pivot [m], raising positive."""
    c, s = math.cos(angle), math.sin(angle)
    rod_x = k[K_LIFT_PIN] * c - k[K_LIFT_PIN + 1] * s
    rod_z = k[K_LIFT_PIN] * s + k[K_LIFT_PIN + 1] * c
    x, z = rod_x - k[K_LIFT_BASE], rod_z - k[K_LIFT_BASE + 1]
    length = math.sqrt(x * x + z * z)
    return length, (z * rod_x - x * rod_z) / length


@uncounted
def crank_pin(k: Array, arm_angle: float, tilt_angle: float) -> tuple[float, float, float]:
    """Angle of the crank's link arm [rad], and how far the link's pin on the bucket is from the crank's pivot: x, z [m]."""
    c, s = math.cos(arm_angle), math.sin(arm_angle)
    crank_x = k[K_CRANK] * c - k[K_CRANK + 1] * s
    crank_z = k[K_CRANK] * s + k[K_CRANK + 1] * c
    ct, st = math.cos(tilt_angle - k[K_CARRY]), math.sin(tilt_angle - k[K_CARRY])
    x = k[K_ARM_LENGTH] * c + k[K_BUCKET] * ct - k[K_BUCKET + 1] * st - crank_x
    z = k[K_ARM_LENGTH] * s + k[K_BUCKET] * st + k[K_BUCKET + 1] * ct - crank_z
    square, arm, link = x * x + z * z, k[K_LINK_ARM], k[K_LINK]
    # law of cosines in the triangle of link arm, link, and the line between their outer ends
    opening = math.acos((arm * arm + square - link * link) / (2.0 * arm * math.sqrt(square)))
    return math.atan2(z, x) - opening, x, z


@uncounted
def tilt_cylinder(k: Array, arm_angle: float, tilt_angle: float) -> tuple[float, float, float]:
    """Length of the tilt cylinder [m]; moment per newton of its push on the bucket about its pin, and about the arm's pivot [m].

    By equilibrium of the crank: the push has a moment about the crank's pivot, which the link's force balances
    and takes to the bucket.
    """
    at, x, z = crank_pin(k, arm_angle, tilt_angle)
    c, s = math.cos(arm_angle), math.sin(arm_angle)
    px, pz = k[K_LINK_ARM] * math.cos(at), k[K_LINK_ARM] * math.sin(at)  # from the crank's pivot
    ux, uz = k[K_CYLINDER_ARM] * math.cos(at + k[K_BETWEEN]), k[K_CYLINDER_ARM] * math.sin(at + k[K_BETWEEN])
    end_x = k[K_CRANK] * c - k[K_CRANK + 1] * s + ux
    end_z = k[K_CRANK] * s + k[K_CRANK + 1] * c + uz
    ex, ez = end_x - k[K_TILT_BASE], end_z - k[K_TILT_BASE + 1]
    length = math.sqrt(ex * ex + ez * ez)
    ex, ez = ex / length, ez / length
    tx, tz = (x - px) / k[K_LINK], (z - pz) / k[K_LINK]
    ct, st = math.cos(tilt_angle - k[K_CARRY]), math.sin(tilt_angle - k[K_CARRY])
    bx, bz = k[K_BUCKET] * ct - k[K_BUCKET + 1] * st, k[K_BUCKET] * st + k[K_BUCKET + 1] * ct
    on_bucket = (ux * ez - uz * ex) * (bx * tz - bz * tx) / (px * tz - pz * tx)
    return length, on_bucket, end_x * ez - end_z * ex


@uncounted
def cylinder_forces(
    k: Array, arm_angle: float, tilt_angle: float, arm_torque: float, bucket_torque: float
) -> tuple[float, float]:
    """Forces of lift and tilt cylinders [N], extending positive, for the torques at the joints of arm and bucket [N m]."""
    _, on_bucket, on_arm = tilt_cylinder(k, arm_angle, tilt_angle)
    _, lever = lift_cylinder(k, arm_angle)
    tilting = bucket_torque / on_bucket
    return (arm_torque - tilting * on_arm) / lever, tilting


@uncounted
def pressures(
    k: Array, arm_angle: float, tilt_angle: float, arm_torque: float, bucket_torque: float
) -> tuple[float, float]:
    """Head-side pressures of lift and tilt cylinders [Pa] for the torques at the joints of arm and bucket [N m].

    At least zero: where a cylinder has to pull, its rod side carries and the head side is empty.
    """
    lifting, tilting = cylinder_forces(k, arm_angle, tilt_angle, arm_torque, bucket_torque)
    return (
        max((lifting + k[K_LIFT_BACK] * k[K_LIFT_ROD]) / k[K_LIFT_HEAD], 0.0),
        max((tilting + k[K_TILT_BACK] * k[K_TILT_ROD]) / k[K_TILT_HEAD], 0.0),
    )
