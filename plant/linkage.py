"""Cylinder pressures of the working equipment from the torques at its joints.

Lift: cylinders between front frame and arm, from their pins. They carry the whole moment about the
arm's pivot; the tilt linkage is taken to react on the arm. Tilt: constructed, a constant moment arm
of stroke over angular range, with hydraulics that keep the bucket level while the arm moves.
Left out: friction of pins and seals, pressure loss in the lines, the real tilt linkage.
"""

import math

from plant.machine import Lift, Tilt


def _areas(count: float, bore: float, rod: float) -> tuple[float, float]:
    """Head-side and rod-side area of all cylinders together [m²]."""
    head = count * math.pi / 4.0 * bore**2
    return head, head - count * math.pi / 4.0 * rod**2


def lift_cylinder(lift: Lift, angle: float) -> tuple[float, float]:
    """Length of the lift cylinders between their pins [m] and moment arm about the arm's pivot [m].

    The moment arm is d(length)/d(angle): positive where extension raises the arm.
    """
    c, s = math.cos(angle), math.sin(angle)
    along, above = lift.rod_pin_along, lift.rod_pin_above
    rod_x, rod_z = along * c - above * s, along * s + above * c  # from the arm's pivot
    x = rod_x + lift.pivot_x - lift.base_x
    z = rod_z + lift.pivot_z - lift.base_z
    length = math.hypot(x, z)
    return length, (z * rod_x - x * rod_z) / length


def lift_pressure(lift: Lift, angle: float, torque: float) -> float:
    """Head-side pressure [Pa] for a raising torque at the arm's joint [N m]; at least zero.

    Under a lowering torque (bucket pushed down) the rod side carries and the head side is empty.
    """
    _, arm = lift_cylinder(lift, angle)
    head, rod = _areas(lift.cylinder_count, lift.bore, lift.rod)
    return max((torque / arm + lift.back_pressure * rod) / head, 0.0)


def tilt_pressure(tilt: Tilt, torque: float) -> float:
    """Head-side pressure [Pa] for a roll-back torque at the bucket's joint [N m]; at least zero."""
    arm = tilt.stroke / (tilt.upper_limit - tilt.lower_limit)
    head, rod = _areas(tilt.cylinder_count, tilt.bore, tilt.rod)
    return max((torque / arm + tilt.back_pressure * rod) / head, 0.0)
