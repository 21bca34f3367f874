"""Turning: yaw moment about the centre of gravity (thesis 2.6) and torque at the joint.

They are different quantities: the first turns the machine, the second bends it; no constant gain
leads from one to the other. ISO 8855, left +. Wheel forces along the wheels' own axes, FL FR RL RR.
"""

import math
from typing import NamedTuple

from ecu.estimators.compiled import compiled, inlined
from ecu.estimators.joint import Joint
from ecu.estimators.parameters import Body, Geometry
from ecu.estimators.quantities import WheelForces


@compiled
def to_rear_axes(x: float, y: float, articulation_angle: float) -> tuple[float, float]:
    """Force of a front wheel in the axes of the rear frame: (93) corrected (E-26)."""
    c, s = math.cos(articulation_angle), math.sin(articulation_angle)
    return x * c - y * s, x * s + y * c


@compiled
def yaw_moment(
    forces: WheelForces, centre_x: float, centre_y: float, articulation_angle: float, geometry: Geometry
) -> float:
    """Moment of the tyre forces about the CoG [N m], (94) with signed distances; aligning moments are
    added by the caller (E-27)."""
    c, s = math.cos(articulation_angle), math.sin(articulation_angle)
    lf, lr = geometry.front_length, geometry.rear_length
    front, rear = geometry.front_track / 2.0, geometry.rear_track / 2.0
    f1x, f1y = to_rear_axes(forces.x1, forces.y1, articulation_angle)
    f2x, f2y = to_rear_axes(forces.x2, forces.y2, articulation_angle)
    m1 = (lf * c - front * s - centre_x) * f1y - (lf * s + front * c - centre_y) * f1x
    m2 = (lf * c + front * s - centre_x) * f2y - (lf * s - front * c - centre_y) * f2x
    m3 = (-lr - centre_x) * forces.y3 - (rear - centre_y) * forces.x3
    m4 = (-lr - centre_x) * forces.y4 - (-rear - centre_y) * forces.x4
    return m1 + m2 + m3 + m4


class Bending(NamedTuple):
    """Solution of the planar two-body equations: acceleration of the joint in rear axes [m/s2], yaw
    acceleration of the rear frame [rad/s2], torque of the rear frame on the front frame [N m]."""

    joint_x: float
    joint_y: float
    yaw_acceleration: float
    torque: float


@compiled
def joint_torque(
    forces: WheelForces,
    front_moment: float,
    rear_moment: float,
    articulation_angle: float,
    yaw_rate: float,
    articulation_rate: float,
    articulation_acceleration: float,
    front: Body,
    rear: Body,
    geometry: Geometry,
) -> Bending:
    """Torque at the articulation joint from the tyre forces (docs/explanation/estimators.md), planar two-body dynamics.

    front_moment, rear_moment: sums of the aligning moments of each axle [N m]; yaw_rate of the rear
    frame. The rear lump includes the rear axle. Gravity's part along a slope drops out when the
    forces balance it, as the solution is in terms of specific force.
    """
    c, s = math.cos(articulation_angle), math.sin(articulation_angle)
    lf, lr = geometry.front_length, geometry.rear_length
    cf, cr = front.x, -rear.x  # distances from the joint
    wf = yaw_rate + articulation_rate
    mf = lf * (forces.y1 + forces.y2) + geometry.front_track / 2.0 * (forces.x2 - forces.x1) + front_moment
    mr = -lr * (forces.y3 + forces.y4) + geometry.rear_track / 2.0 * (forces.x4 - forces.x3) + rear_moment
    fx, fy = to_rear_axes(forces.x1 + forces.x2, forces.y1 + forces.y2, articulation_angle)
    # sum of forces: m a_J + (m_f c_f n_f - m_r c_r n_r) w' = F + centripetal terms
    mass = front.mass + rear.mass
    ff, rr = front.mass * cf, rear.mass * cr
    gx = fx + forces.x3 + forces.x4 + ff * c * wf * wf - rr * yaw_rate * yaw_rate
    gy = fy + forces.y3 + forces.y4 + ff * s * wf * wf
    gx += ff * s * articulation_acceleration
    gy -= ff * c * articulation_acceleration
    # sum of moments about the joint removes T: (I_f + I_r) w' + I_f d'' + (ff n_f - rr n_r) a_J = M_f + M_r
    front_inertia = front.yaw_inertia + ff * cf
    rear_inertia = rear.yaw_inertia + rr * cr
    px, py = -ff * s, ff * c - rr  # coefficient of w' in the force balance and of a_J in the moment balance
    inertia = front_inertia + rear_inertia
    moment = mf + mr - front_inertia * articulation_acceleration
    change = (moment - (px * gx + py * gy) / mass) / (inertia - (px * px + py * py) / mass)
    joint_x = (gx - px * change) / mass
    joint_y = (gy - py * change) / mass
    torque = front_inertia * (change + articulation_acceleration) + ff * (c * joint_y - s * joint_x) - mf
    return Bending(joint_x, joint_y, change, torque)


class Lateral(NamedTuple):
    """Lateral force of the front axle in front axes and of the rear axle [N], and the joint torque [N m]."""

    front: float
    rear: float
    joint_torque: float


@inlined
def lateral_forces(
    side_force: float,
    moment: float,
    front_moment: float,
    longitudinal: WheelForces,
    trail: float,
    joint: Joint,
    geometry: Geometry,
) -> Lateral:
    """Lateral axle forces and joint torque that the measured motion requires: 2.9 backwards.

    side_force: sum of mass times specific force along y of the rear frame [N]; moment: rate of change
    of angular momentum about the joint, gravity included [N m]; front_moment: the front unit's part,
    about the joint; longitudinal: wheel forces along x; trail: pneumatic trail with the sign of travel [m].
    """
    c, s = joint.cosine, joint.sine
    lf, lr = geometry.front_length - trail, geometry.rear_length + trail
    front_x = geometry.front_track / 2.0 * (longitudinal.x2 - longitudinal.x1)
    rear_x = geometry.rear_track / 2.0 * (longitudinal.x4 - longitudinal.x3)
    side = side_force - (longitudinal.x1 + longitudinal.x2) * s
    front = (moment - front_x - rear_x + lr * side) / (lf + lr * c)
    return Lateral(front, side - front * c, front_moment - front_x - lf * front)
