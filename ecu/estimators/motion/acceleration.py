"""Motion of the machine: kinematics from wheel speed (thesis 2.5) and the inertial sensor.

ISO 8855, rear frame axes, origin at the articulation joint. The kinematic part holds without lateral
slip; it includes the centripetal term that the print lacks (E-18).
"""

import math

from ecu.estimators.compiled import compiled, inlined
from ecu.estimators.parameters import Geometry
from ecu.estimators.quantities import Vector


@compiled
def yaw_rate(speed: float, articulation_angle: float, articulation_rate: float, geometry: Geometry) -> float:
    """Yaw rate of the rear frame [rad/s] from the rear axle's speed [m/s], without lateral slip."""
    lf, lr = geometry.front_length, geometry.rear_length
    c, s = math.cos(articulation_angle), math.sin(articulation_angle)
    return (speed * s - lf * articulation_rate) / (lf + lr * c)


@compiled
def yaw_acceleration(
    speed: float,
    acceleration: float,
    articulation_angle: float,
    articulation_rate: float,
    articulation_acceleration: float,
    geometry: Geometry,
) -> float:
    """Time derivative of `yaw_rate` [rad/s2] for the rates of change given."""
    lf, lr = geometry.front_length, geometry.rear_length
    c, s = math.cos(articulation_angle), math.sin(articulation_angle)
    base = lf + lr * c
    numerator = acceleration * s + speed * c * articulation_rate - lf * articulation_acceleration
    return numerator / base + (speed * s - lf * articulation_rate) * lr * s * articulation_rate / (
        base * base
    )


@inlined
def planar_acceleration(
    joint_x: float, joint_y: float, x: float, y: float, rate: float, change: float
) -> tuple[float, float]:
    """Acceleration [m/s2] of a point fixed at (x, y) to a frame that yaws with `rate` and `change`
    [rad/s, rad/s2] about a joint with acceleration (joint_x, joint_y)."""
    return joint_x - change * y - rate * rate * x, joint_y + change * x - rate * rate * y


@compiled
def joint_acceleration(
    speed: float, acceleration: float, rate: float, change: float, geometry: Geometry
) -> tuple[float, float]:
    """Acceleration of the joint [m/s2]; the rear axle moves straight ahead with `speed`."""
    lr = geometry.rear_length
    return acceleration - rate * rate * lr, lr * change + rate * speed


@compiled
def transported(force: Vector, rate: Vector, change: Vector, x: float, y: float, z: float) -> Vector:
    """Specific force [m/s2] at a point (x, y, z) away from the sensor, on the same rigid body.

    rate, change: angular velocity and acceleration [rad/s, rad/s2].
    """
    cx = rate.y * z - rate.z * y
    cy = rate.z * x - rate.x * z
    cz = rate.x * y - rate.y * x
    return Vector(
        force.x + change.y * z - change.z * y + rate.y * cz - rate.z * cy,
        force.y + change.z * x - change.x * z + rate.z * cx - rate.x * cz,
        force.z + change.x * y - change.y * x + rate.x * cy - rate.y * cx,
    )


@compiled
def gravity_reaction(pitch: float, roll: float, gravity: float) -> Vector:
    """Specific force of a body at rest [m/s2]: minus gravity in body axes; pitch nose down +, roll left up +."""
    c = math.cos(pitch)
    return Vector(-gravity * math.sin(pitch), gravity * math.sin(roll) * c, gravity * math.cos(roll) * c)
