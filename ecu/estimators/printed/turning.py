"""Turning torque as the thesis prints it (93), (94)."""

import math

from ecu.estimators.compiled import compiled
from ecu.estimators.parameters import Geometry
from ecu.estimators.quantities import WheelForces


@compiled
def to_rear_axes_printed(x: float, y_right: float, angle_right: float) -> tuple[float, float]:
    """(93) as printed, thesis' frame (y right, delta to the right): not a rotation; at delta = 0 the
    lateral force vanishes from the lateral component."""
    s, c = math.sin(math.pi / 2.0 - angle_right), math.cos(math.pi / 2.0 - angle_right)
    return x * s - y_right * s, x * c + y_right * c


@compiled
def yaw_moment_printed(
    forces: WheelForces, centre_x: float, centre_y: float, articulation_angle: float, geometry: Geometry
) -> float:
    """(94) with (93) as printed; inputs in ISO 8855, mapped to the thesis' frame inside [N m]."""
    d = -articulation_angle
    yc = -centre_y
    c, s = math.cos(d), math.sin(d)
    lf, front, rear = geometry.front_length, geometry.front_track / 2.0, geometry.rear_track / 2.0
    a1 = abs(centre_x - (lf * c + front * s))
    a2 = abs(centre_x - (lf * c - front * s))
    ar = abs(centre_x + geometry.rear_length)
    b1 = abs(yc - (lf * s - front * c))
    b2 = abs(yc - (lf * s + front * c))
    b3, b4 = abs(yc + rear), abs(yc - rear)
    f1x, f1y = to_rear_axes_printed(forces.x1, -forces.y1, d)
    f2x, f2y = to_rear_axes_printed(forces.x2, -forces.y2, d)
    longitudinal = -f1x * b1 + f2x * b2 - forces.x3 * b3 + forces.x4 * b4
    return longitudinal - f1y * a1 - f2y * a2 - forces.y3 * ar - forces.y4 * ar
