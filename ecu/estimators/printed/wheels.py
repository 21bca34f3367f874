"""Slip and tyre force of each wheel in the printed form: the machine rolls without sliding sideways at its rear axle."""

import math

from ecu.estimators.compiled import compiled
from ecu.estimators.parameters import Geometry, MagicFormula, Wheel
from ecu.estimators.printed import tyre
from ecu.estimators.quantities import NormalForces, WheelForces
from ecu.estimators.signals import Inputs


@compiled
def slips_of_rolling(i: Inputs, yaw: float, v: float, n: NormalForces, w: Wheel, g: Geometry) -> WheelForces:
    """Longitudinal slip of each wheel (x1..x4), and the tangent of its slip angle (y1..y4).

    yaw: of the rear frame [rad/s]; v: speed of the rear axle [m/s].
    """
    d, dd = i.articulation_angle, i.articulation_rate
    c, s = math.cos(d), math.sin(d)
    joint_y = g.rear_length * yaw
    axle_x = v * c + joint_y * s
    axle_y = -v * s + joint_y * c + g.front_length * (yaw + dd)
    turn_front, turn_rear = g.front_track / 2.0 * (yaw + dd), g.rear_track / 2.0 * yaw
    r1 = tyre.radius(n.front_left, w.front_stiffening, w)
    r2 = tyre.radius(n.front_right, w.front_stiffening, w)
    r3 = tyre.radius(n.rear_left, w.rear_stiffening, w)
    r4 = tyre.radius(n.rear_right, w.rear_stiffening, w)
    low = w.low_speed
    return WheelForces(
        tyre.slip(i.wheel_speed_1, r1, axle_x - turn_front, low),
        tyre.slip(i.wheel_speed_2, r2, axle_x + turn_front, low),
        tyre.slip(i.wheel_speed_3, r3, v - turn_rear, low),
        tyre.slip(i.wheel_speed_4, r4, v + turn_rear, low),
        -axle_y / max(abs(axle_x - turn_front), low),
        -axle_y / max(abs(axle_x + turn_front), low),
        0.0,
        0.0,
    )


@compiled
def force_of_slip(
    u: float, slip: float, v: float, normal: float, pressure: float, dt: float, w: Wheel, m: MagicFormula
) -> tuple[float, float]:
    """Deflection of the contact point [m] and the tyre's longitudinal force [N] (33)-(35)."""
    sigma = w.longitudinal_relaxation
    new = tyre.contact_point(u, slip * max(abs(v), w.low_speed), v, sigma, dt)
    return new, tyre.magic_formula(new / sigma, normal, pressure, m)
