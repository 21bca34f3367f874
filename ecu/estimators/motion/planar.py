"""Motion in the plane with tyres that slip: the turn that follows from an articulation angle and rate.

The machine turns less than its geometry says: tyres need a slip angle to push sideways and push no harder
than their grip. Two bodies joined at the articulation, whose angle is prescribed; one lateral force per
axle by the brush model. State: velocity of the joint to the left and yaw rate of the rear frame. ISO 8855,
rear frame axes. Left out: relaxation of the tyres, load transfer within an axle, roll.
"""

from typing import NamedTuple

from ecu.estimators.compiled import inlined
from ecu.estimators.joint import Joint
from ecu.estimators.parameters import GRAVITY, Body, Geometry, Wheel
from ecu.estimators.tyres.tyre import sideways


class Steering(NamedTuple):
    """Prescribed motion: articulation, speed of the rear axle, and the specific force at rest."""

    joint: Joint
    rate: float  # [rad/s]
    change: float  # of the rate [rad/s2]
    speed: float  # [m/s]
    acceleration: float  # [m/s2]
    gravity_x: float  # [m/s2]
    gravity_y: float
    arm_side: float  # force to the left that arm and bucket need to move on the front frame, rear axes [N]
    arm_yaw: float  # ... and moment about the joint [N m]


class LateralState(NamedTuple):
    """Lateral state: velocity of the joint to the left [m/s] and yaw rate [rad/s], and their changes."""

    drift: float
    yaw_rate: float
    drift_change: float  # [m/s2]
    yaw_change: float  # [rad/s2]


class SideForce(NamedTuple):
    """Lateral force of an axle [N] and its change with the axle's lateral velocity [N s/m]."""

    force: float
    slope: float


@inlined
def side_force(along: float, across: float, load: float, dt: float, wheel: Wheel) -> SideForce:
    """Lateral force of an axle that moves with `along` and `across` [m/s] under `load` [N].

    Its slope is that of the brush model's tangent. Where the tyre would bring its load to rest within the
    step `dt` [s] it is that of the secant: a sliding tyre has no tangent to stop it from overshooting.
    """
    forward = max(abs(along), wheel.low_speed)
    force = sideways(-across / forward, load, wheel)
    steepest = -wheel.cornering_stiffness * max(load, 0.0) / forward
    if abs(across) * load > abs(force) * GRAVITY * dt:
        used = wheel.cornering_stiffness / (3.0 * wheel.lateral_peak) * abs(across) / forward
        left = max(1.0 - used, 0.0)
        return SideForce(force, steepest * left * left)
    if abs(across) < 1e-6 * forward:
        return SideForce(force, steepest)
    return SideForce(force, force / across)


@inlined
def lateral_step(
    drift: float,
    yaw_rate: float,
    steering: Steering,
    front_load: float,
    rear_load: float,
    dt: float,
    front: Body,
    rear: Body,
    wheel: Wheel,
    geometry: Geometry,
) -> LateralState:
    """The lateral state after `dt` [s], implicit in the tyres' forces so that crawling is as stable as driving.

    front_load, rear_load: normal forces of the axles [N]; rear: the rear unit with its axle.
    """
    c, s = steering.joint.cosine, steering.joint.sine
    u, turn = steering.speed, yaw_rate + steering.rate
    lf, lr = geometry.front_length, geometry.rear_length
    f = side_force(u * c + drift * s, -u * s + drift * c + lf * turn, front_load, dt, wheel)
    r = side_force(u, drift - lr * yaw_rate, rear_load, dt, wheel)
    trail = wheel.pneumatic_trail if u >= 0.0 else -wheel.pneumatic_trail
    front_arm, rear_arm = lf - trail, lr + trail

    mass = front.mass + rear.mass
    first = front.mass * front.x  # first and second moments of mass about the joint
    balance = first * c + rear.mass * rear.x
    front_second = front.yaw_inertia + first * front.x
    second = front_second + rear.yaw_inertia + rear.mass * rear.x * rear.x
    ahead = steering.acceleration - yaw_rate * drift + steering.gravity_x
    aside = yaw_rate * u + steering.gravity_y
    push = mass * ahead / (2.0 + 2.0 * c)  # of each wheel; the front pair's part to the side is 2 push s
    side = f.force * c + r.force + 2.0 * push * s
    side -= mass * aside + first * (steering.change * c - turn * turn * s) + steering.arm_side
    moment = front_arm * f.force - rear_arm * r.force
    moment -= balance * aside + front_second * steering.change - first * s * ahead + steering.arm_yaw

    a11 = mass / dt - f.slope * c * c - r.slope
    a12 = balance / dt - f.slope * c * lf + r.slope * lr + mass * u
    a21 = balance / dt - front_arm * f.slope * c + rear_arm * r.slope
    a22 = second / dt - front_arm * f.slope * lf - rear_arm * r.slope * lr + balance * u
    determinant = a11 * a22 - a12 * a21
    more_drift = (side * a22 - moment * a12) / determinant
    more_yaw = (moment * a11 - side * a21) / determinant
    return LateralState(drift + more_drift, yaw_rate + more_yaw, more_drift / dt, more_yaw / dt)
