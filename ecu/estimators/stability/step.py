"""One step of a prediction: articulation, speed, slide of the tyres, lift arm and bucket, the loads that follow.

The same functions step one machine (`prediction.predict`) and many side by side (`lanes`). ISO 8855, joint origin, rear frame axes.
"""

import math
from typing import NamedTuple

from ecu.estimators.compiled import compiled, inlined
from ecu.estimators.joint import Joint, joint_at, slight, turned
from ecu.estimators.loads.arm_forces import NO_ARM_FORCES, arm_forces
from ecu.estimators.loads.cog import front_unit_in, pose_of
from ecu.estimators.loads.normal_force import normal_forces
from ecu.estimators.motion.arm import Turning
from ecu.estimators.motion.planar import Steering, lateral_step
from ecu.estimators.parameters import GRAVITY, Geometry, LinkageDrive, PredictionRules
from ecu.estimators.quantities import NormalForces, Vector
from ecu.estimators.stability.levers import Levers, driven, share_followed
from ecu.estimators.stability.rocking import (
    STILL,
    RestoringMatrix,
    Rocking,
    rocked,
    rocking_from,
    with_rocking,
)
from ecu.estimators.stability.rollover import LoadedMachine, loads_of, margin


class PredictionState(NamedTuple):
    """The machine's motion and the driver's demand at the beginning of a prediction."""

    articulation_angle: float  # [rad]
    articulation_rate: float  # [rad/s]
    demanded_rate: float  # articulation rate that the driver asks for [rad/s]
    speed: float  # of the rear axle [m/s], reverse negative
    acceleration: float  # of it, along the rear frame [m/s2]
    gravity_x: float  # specific force of rest on this ground, rear axes [m/s2]
    gravity_y: float
    gravity_z: float
    ground: Vector  # the same in axes of the ground, on which the machine leans [m/s2]
    drift: float  # velocity of the joint to the left [m/s]
    yaw_rate: float  # of the rear frame [rad/s]
    front_left: float  # normal force of this wheel [N]
    front_right: float
    rear_load: float  # ... of both rear wheels together
    left_rate: float  # of the front left wheel's load by the tilt on the tyres [N/s]
    right_rate: float  # ... of the right one's; the rear wheels lose what both gain
    levers: Levers  # lift arm and bucket, and what is demanded of them


@inlined
def steered(
    rate: float,
    target: float,
    angle: float,
    share: float,
    dt: float,
    geometry: Geometry,
    prediction: PredictionRules,
) -> float:
    """Articulation rate after `dt` [s]: it follows the target with the steering's lag (`share` of the way in
    a step), no faster than the steering can, and fades as the cushion of the end stop makes it."""
    follow = (target - rate) * share
    most = prediction.steering_acceleration * dt
    then = rate + min(max(follow, -most), most)
    left = geometry.articulation_stop - abs(angle)
    if then * angle > 0.0:
        cushioned = max(left, 0.0) / prediction.cushion
        then = min(max(then, -cushioned), cushioned)
    return then


class Rates(NamedTuple):
    """What is the same in every step of a prediction."""

    step: float  # [s]
    fade: float  # of the longitudinal acceleration in a step
    steering_share: float  # of the way to its demand that the articulation rate goes in a step
    drive_share: float  # ... and the rates of lift arm and bucket


@compiled
def rates_of(prediction: PredictionRules, drive: LinkageDrive) -> Rates:
    """The rates of this machine's steps."""
    dt = prediction.step
    return Rates(
        dt,
        math.exp(-dt / prediction.acceleration_memory),
        1.0 - math.exp(-dt / prediction.steering_lag),
        share_followed(dt, drive),
    )


class Course(NamedTuple):
    """The machine within a prediction, and the least margin so far."""

    joint: Joint  # the articulation
    rate: float  # [rad/s]
    speed: float  # [m/s]
    acceleration: float  # [m/s2]
    drift: float  # [m/s]
    yaw: float  # rate [rad/s]
    front_load: float  # [N]
    rear_load: float
    gravity_x: float  # [m/s2]
    gravity_y: float
    rocking: Rocking
    lift: Turning
    tilt: Turning
    pivot: Joint  # of the lift arm
    pin: Joint  # of the bucket
    forces: NormalForces
    worst: float  # smallest margin so far
    lifting: float  # the wheel of that margin


@compiled
def course_from(start: PredictionState, standing: NormalForces, carried: float) -> Course:
    """The machine before the first step; standing: its loads at rest [N]; carried: tilt angle of the bucket as carried [rad]."""
    levers = start.levers
    return Course(
        joint_at(start.articulation_angle), start.articulation_rate, start.speed, start.acceleration, start.drift,
        start.yaw_rate, start.front_left + start.front_right, start.rear_load, start.gravity_x, start.gravity_y, STILL,
        Turning(levers.lift_angle, levers.lift_rate, 0.0, levers.lift_angle),
        Turning(levers.tilt_angle, levers.tilt_rate, 0.0, levers.tilt_angle),
        joint_at(levers.lift_angle), joint_at(levers.tilt_angle - carried),
        standing, 1e9, 0.0,
    )  # fmt: skip


@inlined
def loaded(
    c: Course,
    first: bool,
    held: bool,
    arm_moves: bool,
    start: PredictionState,
    restoring: RestoringMatrix,
    rates: Rates,
    machine: LoadedMachine,
) -> Course:
    """The machine with the loads of this step.

    restoring: of the tyres at the start; first: whether nothing has been driven or steered yet; held: whether the demands still last; arm_moves: whether arm or bucket
    moves or is to move.
    """
    geometry, prediction, dt, joint = machine.geometry, machine.prediction, rates.step, c.joint
    change, rate = 0.0, c.rate
    if not first:
        target = start.demanded_rate if held else 0.0
        rate = steered(c.rate, target, joint.angle, rates.steering_share, dt, geometry, prediction)
        change = (rate - c.rate) / dt
    front, arm = machine.front, NO_ARM_FORCES
    lift, tilt, pivot, pin = c.lift, c.tilt, c.pivot, c.pin
    if arm_moves:
        if not first:
            lift, tilt = driven(lift, tilt, start.levers, held, dt, rates.drive_share, machine.drive)
            pivot, pin = turned(pivot, lift.angle), turned(pin, tilt.angle - machine.bucket.carried)
        pose = pose_of(pivot, pin, machine.arm, machine.bucket)
        if not first:
            front = front_unit_in(pose, machine.payload, machine.frame, machine.arm, machine.bucket)
        arm = arm_forces(pose, lift, tilt, c.yaw + rate, machine.payload, machine.arm, machine.bucket)
    steering = Steering(
        joint, rate, change, c.speed, c.acceleration, c.gravity_x, c.gravity_y,
        arm.x * joint.sine + arm.y * joint.cosine, arm.yawing,
    )  # fmt: skip
    slide = lateral_step(
        c.drift, c.yaw, steering, c.front_load, c.rear_load, dt, front, machine.rear_unit, machine.wheel, geometry
    )  # fmt: skip
    loads = loads_of(
        c.acceleration - c.yaw * c.drift, slide.drift_change + c.yaw * c.speed, c.yaw, slide.yaw_change, joint, rate,
        change, Vector(c.gravity_x, c.gravity_y, start.gravity_z), front, machine.rear, machine.axle, geometry, arm,
    )  # fmt: skip
    resting = normal_forces(loads.support, joint, loads.axle_load, loads.axle_moment, geometry)
    if first:
        rocking = rocking_from(
            start.front_left, start.front_right, start.rear_load, start.left_rate, start.right_rate, resting,
            GRAVITY * (front.mass + machine.rear_unit.mass),
        )  # fmt: skip
    else:
        rocking = rocked(c.rocking, resting, dt, restoring)
    forces = with_rocking(resting, rocking)
    now = margin(forces, machine.standing)
    less = now.ratio < c.worst
    return Course(
        joint, rate, c.speed, c.acceleration, slide.drift, slide.yaw_rate,
        forces.front_left + forces.front_right, forces.rear_left + forces.rear_right, c.gravity_x, c.gravity_y,
        rocking, lift, tilt, pivot, pin, forces,
        now.ratio if less else c.worst, now.wheel if less else c.lifting,
    )  # fmt: skip


@inlined
def moved_on(c: Course, rates: Rates, stop: float) -> Course:
    """The machine a step later, before its loads are known; stop: largest articulation angle [rad]."""
    dt = rates.step
    cosine, sine = slight(c.yaw * dt)
    faster = c.speed + c.acceleration * dt
    return Course(
        turned(c.joint, min(max(c.joint.angle + c.rate * dt, -stop), stop)), c.rate,
        faster if faster * c.speed > 0.0 else 0.0, c.acceleration * rates.fade, c.drift, c.yaw,
        c.front_load, c.rear_load, c.gravity_x * cosine + c.gravity_y * sine, c.gravity_y * cosine - c.gravity_x * sine,
        c.rocking, c.lift, c.tilt, c.pivot, c.pin, c.forces, c.worst, c.lifting,
    )  # fmt: skip
