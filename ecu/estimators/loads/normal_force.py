"""Normal force on each tyre from mass distribution and specific force (thesis 2.4.3, 2.4.4).

The machine stands on three points: the front wheels and the oscillation pivot of the rear axle. The
resultant of weight and inertia forces meets the ground at the *support point* (x, y); the shares of
the three points are the barycentric coordinates of that point in their triangle, and a wheel lifts
when the point leaves the triangle. ISO 8855, origin at the joint, rear frame axes. Wheel order
FL, FR, RL, RR. Negative: the pull that would be needed to keep the wheel down.

Corrected against the print: E-13, E-15 (arm of the pivot force), E-16 (the trunnion carries the pitch
moment), E-17 (lateral share from the yaw balance), E-19 to E-21. The printed forms are in `ecu.estimators.printed`.
"""

import math
from typing import NamedTuple

from ecu.estimators.compiled import compiled, inlined
from ecu.estimators.joint import Joint, joint_at
from ecu.estimators.parameters import Geometry
from ecu.estimators.quantities import Centre, NormalForces


class Support(NamedTuple):
    """The load on the three points: its size and where it meets the ground."""

    load: float  # m f_z: normal load of everything but the rear axle [N]
    x: float  # X' [m]
    y: float  # Y' [m]


@compiled
def standing(
    mass_weight: float, front: float, rear: float, grade: float, height: float
) -> tuple[float, float]:
    """Force on each front and each rear wheel of a straight machine on a grade (60)-(64, E-13).

    mass_weight m g [N]; distances of the CoG to front and rear axle [m]; grade [rad], uphill +;
    height of the CoG [m].
    """
    half, base = mass_weight / 2.0, front + rear
    c, s = math.cos(grade), math.sin(grade)
    return half * (rear * c - height * s) / base, half * (front * c + height * s) / base


@compiled
def accelerating(
    mass: float, gravity: float, front: float, rear: float, height: float, acceleration: float
) -> tuple[float, float]:
    """Force on each front and each rear wheel of a straight machine on level ground (53)-(59)."""
    base = front + rear
    front_force = mass * gravity / 2.0 * rear / base - mass * acceleration / 2.0 * height / base
    rear_force = (mass * acceleration * height + 2.0 * front_force * front) / (2.0 * rear)
    return front_force, rear_force


@compiled
def banked(mass_weight: float, left: float, right: float, bank: float, height: float) -> tuple[float, float]:
    """Force on each right and each left wheel on a bank (65)-(69); bank [rad], right side up +."""
    half, track = mass_weight / 2.0, left + right
    c, s = math.cos(bank), math.sin(bank)
    return half * (left * c - height * s) / track, half * (right * c + height * s) / track


@compiled
def support_point(
    centre: Centre,
    fx: float,
    fy: float,
    fz: float,
    axle_mass: float,
    axle_height: float,
    pivot_height: float,
    lateral_share: float,
) -> Support:
    """Support point of a machine that moves as one body (docs/explanation/estimators.md).

    centre: everything but the rear axle; fx, fy, fz: specific force at it [m/s2]; lateral_share
    lambda_y = F_yR / (m f_y), the pivot's part of the lateral force.
    """
    x = centre.x - (centre.z + axle_mass / centre.mass * axle_height) * fx / fz
    y = centre.y - (centre.z - lateral_share * pivot_height) * fy / fz
    return Support(centre.mass * fz, x, y)


@compiled
def lateral_share(centre_x: float, articulation_angle: float, geometry: Geometry) -> float:
    """lambda_y of a steady turn, from the yaw balance (E-17)."""
    front = geometry.front_length * math.cos(articulation_angle)
    return (front - centre_x) / (front + geometry.rear_length)


@inlined
def normal_forces(
    support: Support,
    joint: Joint,
    axle_load: float,
    axle_moment: float,
    geometry: Geometry,
) -> NormalForces:
    """Normal forces by the barycentric coordinates of the support point (docs/explanation/estimators.md).

    axle_load: m_a f_z of the rear axle [N]; axle_moment: moment about x that lateral and gyroscopic
    forces exert on the rear axle about its contact line, loading the right wheel [N m].
    """
    c, s = joint.cosine, joint.sine
    lf, lr, half = geometry.front_length, geometry.rear_length, geometry.front_track / 2.0
    scale = support.load / (geometry.front_track * (lf + lr * c))
    forward = support.x + lr
    n1 = scale * (forward * (half * c - lf * s) + (lf * c + lr + half * s) * support.y)
    n2 = scale * (forward * (half * c + lf * s) - (lf * c + lr - half * s) * support.y)
    pivot = support.load - n1 - n2
    rear = (pivot + axle_load) / 2.0
    shift = axle_moment / geometry.rear_track
    return NormalForces(n1, n2, pivot, rear - shift, rear + shift)


@compiled
def rigid_normal_forces(
    centre: Centre,
    articulation_angle: float,
    fx: float,
    fy: float,
    fz: float,
    axle_mass: float,
    axle_height: float,
    share: float,
    geometry: Geometry,
) -> NormalForces:
    """The closed form for one rigid body with specific force (fx, fy, fz) [m/s2]."""
    support = support_point(centre, fx, fy, fz, axle_mass, axle_height, geometry.pivot_height, share)
    moment = (share * centre.mass * geometry.pivot_height + axle_mass * axle_height) * fy
    return normal_forces(support, joint_at(articulation_angle), axle_mass * fz, moment, geometry)


@compiled
def on_axle_stop(
    forces: NormalForces, joint: Joint, axle_moment: float, axle_load: float, geometry: Geometry
) -> NormalForces:
    """Forces after a front wheel has lifted and the rear axle has come to its stop.

    The stop turns the axle with the frame by the roll moment M_p that brings the lifted wheel to zero:
    front wheel, pivot and the rear pair share the load of the line they tip about. `forces` are those
    of the free axle; returned unchanged while both front wheels stand.
    """
    lifted_left = forces.front_left < 0.0
    if not (lifted_left or forces.front_right < 0.0):
        return forces
    c, s = joint.cosine, joint.sine
    lf, lr, half = geometry.front_length, geometry.rear_length, geometry.front_track / 2.0
    base = geometry.front_track * (lf + lr * c)
    left_arm = (lf * c + lr + half * s) / base  # change of n1 per N m of -M_p
    right_arm = (lf * c + lr - half * s) / base
    stop = forces.front_left / left_arm if lifted_left else -forces.front_right / right_arm
    n1 = forces.front_left - stop * left_arm
    n2 = forces.front_right + stop * right_arm
    pivot = forces.pivot + forces.front_left + forces.front_right - n1 - n2
    rear = (pivot + axle_load) / 2.0
    shift = (axle_moment - stop) / geometry.rear_track
    return NormalForces(n1, n2, pivot, rear - shift, rear + shift)
