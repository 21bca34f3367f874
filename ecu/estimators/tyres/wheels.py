"""Each wheel by itself: rolling radius, spin balance, slip, force of the tyre model."""

import math

from ecu.estimators.compiled import compiled
from ecu.estimators.parameters import Geometry, MagicFormula, Wheel
from ecu.estimators.quantities import NormalForces, WheelForces
from ecu.estimators.signals import Inputs
from ecu.estimators.state import State
from ecu.estimators.tyres import tyre

RIM, FREE = 0.5, 1.5
"""Loaded radius over the unloaded one, at least and at most: on its rim, and far above what a pull on a lifted wheel gives. The
effective radius has a pole where the axle would be below the road."""


@compiled
def radius(normal: float, stiffening: float, wheel: Wheel) -> float:
    """Effective radius [m] under a normal force [N]."""
    loaded = wheel.unloaded_radius - tyre.deflection(normal, stiffening, wheel)
    possible = min(max(loaded, RIM * wheel.unloaded_radius), FREE * wheel.unloaded_radius)
    return tyre.effective_radius(possible, wheel.unloaded_radius)


@compiled
def spin_balance(torque: float, acceleration: float, normal: float, stiffening: float, w: Wheel) -> float:
    """Longitudinal force [N] that torque, spin and rolling resistance of a wheel require.

    The lever is the effective radius: at it a rolling tyre does no work without slip.
    """
    force = (torque - w.spin_inertia * acceleration) / radius(normal, stiffening, w)
    return force - w.rolling_resistance * max(normal, 0.0)


@compiled
def expected_slip(force: float, normal: float, wheel: Wheel) -> float:
    """Slip [-] that a longitudinal force needs in the linear range, at most 0.1."""
    slip = force / (wheel.slip_stiffness * max(normal, 0.1 * wheel.nominal_load))
    return min(max(slip, -0.1), 0.1)


@compiled
def wheel_slips(
    i: Inputs, yaw: float, v: float, drift: float, n: NormalForces, w: Wheel, g: Geometry
) -> WheelForces:
    """Longitudinal slip of each wheel (x1..x4), and the tangent of its slip angle (y1..y4).

    v: speed of the rear axle along its frame [m/s]; drift: its speed to the left [m/s].
    """
    d, dd = i.articulation_angle, i.articulation_rate
    c, s = math.cos(d), math.sin(d)
    joint_y = drift + g.rear_length * yaw
    axle_x = v * c + joint_y * s
    axle_y = -v * s + joint_y * c + g.front_length * (yaw + dd)
    turn_front, turn_rear = g.front_track / 2.0 * (yaw + dd), g.rear_track / 2.0 * yaw
    r1 = radius(n.front_left, w.front_stiffening, w)
    r2 = radius(n.front_right, w.front_stiffening, w)
    r3 = radius(n.rear_left, w.rear_stiffening, w)
    r4 = radius(n.rear_right, w.rear_stiffening, w)
    low = w.low_speed
    return WheelForces(
        tyre.slip(i.wheel_speed_1, r1, axle_x - turn_front, low),
        tyre.slip(i.wheel_speed_2, r2, axle_x + turn_front, low),
        tyre.slip(i.wheel_speed_3, r3, v - turn_rear, low),
        tyre.slip(i.wheel_speed_4, r4, v + turn_rear, low),
        -axle_y / max(abs(axle_x - turn_front), low),
        -axle_y / max(abs(axle_x + turn_front), low),
        -drift / max(abs(v - turn_rear), low),
        -drift / max(abs(v + turn_rear), low),
    )


@compiled
def transient_force(
    u: float, slip: float, v: float, normal: float, pressure: float, dt: float, w: Wheel, m: MagicFormula
) -> tuple[float, float]:
    """Deflection of the contact point [m] and the tyre model's longitudinal force [N] (33)-(35)."""
    sigma = w.longitudinal_relaxation
    new = tyre.contact_point(u, slip * max(abs(v), w.low_speed), v, sigma, dt)
    return new, tyre.magic_formula(new / sigma, normal, pressure, m)


@compiled
def transient_forces(
    s: State, slips: WheelForces, v: float, n: NormalForces, dt: float, w: Wheel, m: MagicFormula
) -> tuple[WheelForces, WheelForces]:
    """Deflections of the contact points [m] and longitudinal forces of the tyre model [N], as x1..x4; the rest 0."""
    front, rear = w.front_pressure, w.rear_pressure
    u1, x1 = transient_force(s.deflection_1, slips.x1, v, n.front_left, front, dt, w, m)
    u2, x2 = transient_force(s.deflection_2, slips.x2, v, n.front_right, front, dt, w, m)
    u3, x3 = transient_force(s.deflection_3, slips.x3, v, n.rear_left, rear, dt, w, m)
    u4, x4 = transient_force(s.deflection_4, slips.x4, v, n.rear_right, rear, dt, w, m)
    return WheelForces(u1, u2, u3, u4, 0.0, 0.0, 0.0, 0.0), WheelForces(x1, x2, x3, x4, 0.0, 0.0, 0.0, 0.0)


LEAST_TANGENT = 0.02
"""Below this slip a tyre's side force is as its stiffness: which way an axle slides is then not known well."""


@compiled
def side_weight(normal: float, tangent: float, wheel: Wheel) -> float:
    """Side force [N] of a tyre with this tangent of its slip angle, by the brush model with its own stiffness."""
    if normal <= 0.0:
        return 0.0
    sliding = wheel.lateral_peak * normal
    tangent = max(abs(tangent), LEAST_TANGENT)
    s = min(tyre.cornering_stiffness(normal, wheel) / (3.0 * sliding) * tangent, 1.0)
    return 3.0 * sliding * s * (1.0 - s + s * s / 3.0)


@compiled
def shared(
    total: float, left: float, right: float, left_slip: float, right_slip: float, wheel: Wheel
) -> tuple[float, float]:
    """A lateral axle force [N] divided over its wheels as their tyres would push at their loads [N] and slips (tangents).

    The more loaded wheel gets less than its share of the load: its stiffness grows less than its load, and in a turn it runs
    faster, which makes its slip angle smaller.
    """
    a, b = side_weight(left, left_slip, wheel), side_weight(right, right_slip, wheel)
    if a + b <= 0.0:
        return total / 2.0, total / 2.0
    return total * a / (a + b), total * b / (a + b)
