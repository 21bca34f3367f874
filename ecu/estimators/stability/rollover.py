"""Roll-over: load-transfer ratio, margin to lift-off, which wheel lifts first, and the loads of a given motion.

ISO 8855, joint origin, rear frame axes.
"""

import math
from typing import NamedTuple

from ecu.estimators.compiled import compiled, inlined
from ecu.estimators.joint import Joint, joint_at
from ecu.estimators.loads.arm_forces import NO_ARM_FORCES, ArmForces
from ecu.estimators.loads.cog import front_unit, with_axle
from ecu.estimators.loads.normal_force import Support, normal_forces
from ecu.estimators.motion.acceleration import joint_acceleration, planar_acceleration, yaw_rate
from ecu.estimators.parameters import (
    GRAVITY,
    Arm,
    Axle,
    Body,
    Bucket,
    Geometry,
    LinkageDrive,
    Parameters,
    PredictionRules,
    Wheel,
)
from ecu.estimators.quantities import NormalForces, Vector, WheelForces
from ecu.estimators.stability.turning import lateral_forces

LEAST_LOAD = 0.05
"""Share of its weight below which a machine stands nowhere: the moments about the joint are then divided by this much."""


class Margin(NamedTuple):
    """Smallest normal force over its standing value, and its wheel (1 FL, 2 FR, 3 RL, 4 RR)."""

    ratio: float
    wheel: float


class Loads(NamedTuple):
    """Support point and what loads the rear axle, for one state of motion."""

    support: Support
    axle_load: float  # m_a f_z [N]
    axle_moment: float  # about the axle's contact line, loading the right wheel [N m]


class LoadedMachine(NamedTuple):
    """The machine as it is loaded now."""

    front: Body
    rear: Body  # without the rear axle
    rear_unit: Body  # with it
    axle: Axle
    wheel: Wheel
    geometry: Geometry
    prediction: PredictionRules
    standing: NormalForces  # of the straight machine at rest on level ground
    pitch_frequency: float  # on the front tyres, about the rear axle [rad/s]
    frame: Body  # the front frame without arm, bucket and payload
    arm: Arm
    bucket: Bucket
    payload: float  # [kg]
    drive: LinkageDrive


@compiled
def load_transfer_ratio(forces: NormalForces) -> float:
    """(right - left) / sum of the four normal forces; right side heavier +. 0 where the wheels carry nothing together.

    A prediction from inputs that contradict one another runs away, and the sum of its forces may be zero.
    """
    left = forces.front_left + forces.rear_left
    right = forces.front_right + forces.rear_right
    return (right - left) / (right + left) if right + left > 0.0 else 0.0


@compiled
def front_load_transfer_ratio(forces: NormalForces) -> float:
    """(right - left) / sum of the two front normal forces, right side heavier +: 1 when the front left wheel has lifted.

    The thesis watches the front pair, which lifts first on a three-point support (2.4.5). A pull counts as no load; 0 where
    neither front wheel carries anything.
    """
    left, right = max(forces.front_left, 0.0), max(forces.front_right, 0.0)
    return (right - left) / (right + left) if right + left > 0.0 else 0.0


@inlined
def margin(forces: NormalForces, standing: NormalForces) -> Margin:
    """Smallest of the four forces relative to the straight machine standing on level ground."""
    ratio = forces.front_left / standing.front_left
    wheel = 1.0
    other = forces.front_right / standing.front_right
    if other < ratio:
        ratio, wheel = other, 2.0
    other = forces.rear_left / standing.rear_left
    if other < ratio:
        ratio, wheel = other, 3.0
    other = forces.rear_right / standing.rear_right
    if other < ratio:
        ratio, wheel = other, 4.0
    return Margin(ratio, wheel)


@inlined
def loads_of(
    joint_x: float,
    joint_y: float,
    rate: float,
    change: float,
    joint: Joint,
    articulation_rate: float,
    articulation_acceleration: float,
    gravity: Vector,
    front: Body,
    rear: Body,
    axle: Axle,
    geometry: Geometry,
    arm: ArmForces,
) -> Loads:
    """Support point of a machine that moves in the plane, quasi-static in roll and pitch.

    joint_x, joint_y: acceleration of the joint [m/s2]; rate, change: yaw of the rear frame [rad/s, rad/s2];
    gravity: specific force at rest on this ground [m/s2]; arm: of arm and bucket that move on the front frame.
    """
    c, s = joint.cosine, joint.sine
    xf, yf = front.x * c, front.x * s
    front_rate, front_change = rate + articulation_rate, change + articulation_acceleration
    ffx, ffy = planar_acceleration(joint_x, joint_y, xf, yf, front_rate, front_change)
    rfx, rfy = planar_acceleration(joint_x, joint_y, rear.x, 0.0, rate, change)
    afx, afy = planar_acceleration(joint_x, joint_y, -geometry.rear_length, 0.0, rate, change)
    front_force = Vector(
        front.mass * (ffx + gravity.x), front.mass * (ffy + gravity.y), front.mass * gravity.z
    )
    rear_force = Vector(rear.mass * (rfx + gravity.x), rear.mass * (rfy + gravity.y), rear.mass * gravity.z)
    axle_x, axle_y = axle.mass * (afx + gravity.x), axle.mass * (afy + gravity.y)

    push = (front_force.x + rear_force.x + axle_x + arm.x * c - arm.y * s) / (2.0 + 2.0 * c)
    front_moment = front.x * (c * front_force.y - s * front_force.x) + front.yaw_inertia * front_change
    front_moment += arm.yawing
    moment = front_moment + rear.x * rear_force.y + rear.yaw_inertia * change - geometry.rear_length * axle_y
    lateral = lateral_forces(
        front_force.y + rear_force.y + axle_y + arm.x * s + arm.y * c, moment, front_moment,
        WheelForces(push, push, push, push, 0.0, 0.0, 0.0, 0.0), 0.0, joint, geometry,
    )  # fmt: skip
    pivot_side = lateral.rear - axle_y
    load = front_force.z + rear_force.z + arm.z
    x = xf * front_force.z + rear.x * rear_force.z - front.z * front_force.x - rear.z * rear_force.x
    x += arm.pitching * c - arm.rolling * s
    y = yf * front_force.z - front.z * front_force.y - rear.z * rear_force.y
    y += arm.pitching * s + arm.rolling * c
    # an arm that is thrown up may carry the whole machine for a moment
    borne = max(load, LEAST_LOAD * GRAVITY * (front.mass + rear.mass))
    support = Support(
        load, (x - axle.height * axle_x) / borne, (y + geometry.pivot_height * pivot_side) / borne
    )
    axle_moment = geometry.pivot_height * pivot_side + axle.height * axle_y
    return Loads(support, axle.mass * gravity.z, axle_moment)


@compiled
def within_grip(rate: float, speed: float, grip: float) -> float:
    """The yaw rate [rad/s] that tyres can hold at this speed [m/s] of the one that the geometry asks for.

    grip: largest lateral acceleration over gravity that the tyres can give; beyond it the machine turns less
    than its geometry says.
    """
    most = grip * GRAVITY / max(abs(speed), 0.1)
    return min(max(rate, -most), most)


@compiled
def steady_rate(speed: float, articulation_angle: float, grip: float, geometry: Geometry) -> float:
    """Yaw rate [rad/s] of a steady turn; grip: as in `within_grip`."""
    return within_grip(yaw_rate(speed, articulation_angle, 0.0, geometry), speed, grip)


@compiled
def steady_loads(
    speed: float,
    articulation_angle: float,
    gravity: Vector,
    grip: float,
    front: Body,
    rear: Body,
    axle: Axle,
    geometry: Geometry,
) -> Loads:
    """Support point of the machine rolling at a constant angle and speed.

    gravity: specific force at rest on this ground [m/s2]; grip: as in `within_grip`.
    """
    rate = steady_rate(speed, articulation_angle, grip, geometry)
    joint_x, joint_y = joint_acceleration(speed, 0.0, rate, 0.0, geometry)
    return loads_of(
        joint_x, joint_y, rate, 0.0, joint_at(articulation_angle), 0.0, 0.0, gravity, front, rear, axle, geometry,
        NO_ARM_FORCES,
    )  # fmt: skip


@compiled
def standing_forces(front: Body, rear: Body, axle: Axle, geometry: Geometry) -> NormalForces:
    """Normal forces of the straight machine at rest on level ground."""
    loads = steady_loads(0.0, 0.0, Vector(0.0, 0.0, GRAVITY), 0.0, front, rear, axle, geometry)
    return normal_forces(loads.support, joint_at(0.0), loads.axle_load, loads.axle_moment, geometry)


@compiled
def pitch_frequency(front: Body, rear: Body, axle: Axle, prediction: PredictionRules, g: Geometry) -> float:
    """Natural frequency of the pitch on the front tyres [rad/s]: the machine turns about the rear axle's ground contact."""
    behind = g.rear_length
    inertia = front.pitch_inertia + rear.pitch_inertia + axle.mass * axle.height * axle.height
    inertia += front.mass * ((front.x + behind) * (front.x + behind) + front.z * front.z)
    inertia += rear.mass * ((rear.x + behind) * (rear.x + behind) + rear.z * rear.z)
    base = g.front_length + behind
    return math.sqrt(2.0 * prediction.tyre_stiffness * base * base / inertia)


@compiled
def loaded_machine(front: Body, payload: float, p: Parameters) -> LoadedMachine:
    """The machine with this front unit, in which the payload [kg] is, and what follows from its loading."""
    g = p.geometry
    return LoadedMachine(
        front, p.rear, with_axle(p.rear, p.axle, g), p.axle, p.wheel, g, p.prediction,
        standing_forces(front, p.rear, p.axle, g),
        pitch_frequency(front, p.rear, p.axle, p.prediction, g),
        p.front, p.arm, p.bucket, payload, p.linkage_drive,
    )  # fmt: skip


@compiled
def posed(m: LoadedMachine, lift_arm_angle: float, tilt_angle: float) -> LoadedMachine:
    """The same machine with its arm in another pose; its margins stay shares of what its wheels carry now."""
    front = front_unit(lift_arm_angle, tilt_angle, m.payload, m.frame, m.arm, m.bucket)
    return LoadedMachine(
        front, m.rear, m.rear_unit, m.axle, m.wheel, m.geometry, m.prediction, m.standing, m.pitch_frequency,
        m.frame, m.arm, m.bucket, m.payload, m.drive,
    )  # fmt: skip


@compiled
def share_lost(arm: ArmForces, articulation_angle: float, m: LoadedMachine) -> float:
    """Largest share of its standing load that a wheel loses by forces of arm and bucket, quasi-statically; 0 if none does.

    Side forces are taken to act on the ground, as those of the front wheels do: the rear axle's pivot takes some of the roll.
    """
    g = m.geometry
    c, s = math.cos(articulation_angle), math.sin(articulation_angle)
    lf, lr, half = g.front_length, g.rear_length, g.front_track / 2.0
    base = g.front_track * (lf + lr * c)
    along = arm.pitching * c - arm.rolling * s + lr * arm.z
    across = arm.pitching * s + arm.rolling * c
    n1 = (along * (half * c - lf * s) + (lf * c + lr + half * s) * across) / base
    n2 = (along * (half * c + lf * s) - (lf * c + lr - half * s) * across) / base
    behind = (arm.z - n1 - n2) / 2.0
    front = min(n1 / m.standing.front_left, n2 / m.standing.front_right)
    rear = behind / min(m.standing.rear_left, m.standing.rear_right)
    return max(-min(front, rear), 0.0)
