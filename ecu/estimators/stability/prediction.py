"""What will happen to the wheels' loads within the horizon, for warnings and limits.

The prediction propagates articulation, speed, the slide of the tyres and the roll of the machine on its front
tyres over a horizon, so that a warning does not wait for the tilt that the thesis' estimator has to
see first (thesis 2.4.5, results 4.5.6). ISO 8855, joint origin, rear frame axes.
"""

import math
from typing import NamedTuple

from ecu.estimators.compiled import compiled, inlined
from ecu.estimators.joint import joint_at, slight, turned
from ecu.estimators.loads.arm_forces import NO_ARM_FORCES, arm_forces
from ecu.estimators.loads.cog import front_unit_in, pose_of
from ecu.estimators.loads.normal_force import Support, normal_forces
from ecu.estimators.motion.arm import Turning
from ecu.estimators.motion.planar import Steering, lateral_step
from ecu.estimators.parameters import Geometry, PredictionRules
from ecu.estimators.quantities import NormalForces, Vector
from ecu.estimators.signals import NEVER
from ecu.estimators.stability.levers import Levers, driven, moved, share_followed
from ecu.estimators.stability.rollover import LoadedMachine, load_transfer_ratio, loads_of, margin
from ecu.estimators.stability.start import ASIDE, ASIDE_RATE, within

OVERTURNED = -10.0
"""Margin at which a prediction ends in any case: the wheel would have to be held down by ten times its standing load. Four are what a
side force of 1 g and a payload take from a wheel; beyond, the equations of a standing machine say nothing."""


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
    front_load: float  # normal force of the front wheels together [N]
    rear_load: float
    support: float  # present support point along y [m]
    support_rate: float  # [m/s]
    front_load_rate: float  # of both front wheels by the pitch on the tyres; the rear ones lose it [N/s]
    levers: Levers  # lift arm and bucket, and what is demanded of them


class Prediction(NamedTuple):
    """What happens within the horizon, up to the moment when the margin is used up."""

    time_to_lift_off: float  # [s]; NEVER if no wheel lifts
    margin: float  # the smallest over the time looked at; OVERTURNED or more
    wheel: float  # the wheel of that margin (1..4)
    load_transfer_ratio: float  # at the end of that time; as far from 0 as OVERTURNED at most


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


@compiled
def predict(start: PredictionState, hold: float, floor: float, machine: LoadedMachine) -> Prediction:
    """Margin and time to lift-off if the demanded rates last `hold` seconds and then end.

    It looks no further than the moment when the margin falls to `floor`, or to OVERTURNED; 0 is lift-off.

    The articulation rate follows the demand as the steering can and fades before the stop; so do lift arm and bucket. The
    longitudinal acceleration fades; the tyres slip sideways and give what their grip allows; the support
    point follows the quasi-static one as a lightly damped roll mode does, overshoot included. The ground
    keeps its slope while the machine turns on it.
    """
    geometry, prediction = machine.geometry, machine.prediction
    dt = prediction.step
    fade = math.exp(-dt / prediction.acceleration_memory)
    omega = machine.roll_frequency
    damping = 2.0 * prediction.roll_damping * omega
    share = 1.0 - math.exp(-dt / prediction.steering_lag)
    drive_share = share_followed(dt, machine.drive)
    stop = geometry.articulation_stop
    joint, rate = joint_at(start.articulation_angle), start.articulation_rate
    speed, acceleration = start.speed, start.acceleration
    drift, yaw = start.drift, start.yaw_rate
    front_load, rear_load = start.front_load, start.rear_load
    gx, gy = start.gravity_x, start.gravity_y
    offset, support_rate, before = 0.0, within(start.support_rate, ASIDE_RATE), 0.0
    front, arm, levers = machine.front, NO_ARM_FORCES, start.levers
    lift = Turning(levers.lift_angle, levers.lift_rate, 0.0, levers.lift_angle)
    tilt = Turning(levers.tilt_angle, levers.tilt_rate, 0.0, levers.tilt_angle)
    arm_moves, bounce = moved(levers), STILL
    pivot, pin = joint_at(lift.angle), joint_at(tilt.angle - machine.bucket.carried)
    lift_off, worst, lifting, forces, end = NEVER, 1e9, 0.0, machine.standing, max(floor, OVERTURNED)
    for k in range(int(prediction.horizon / dt + 0.5) + 1):
        change = 0.0
        if k > 0:
            target = start.demanded_rate if k * dt < hold else 0.0
            steered_rate = steered(rate, target, joint.angle, share, dt, geometry, prediction)
            change = (steered_rate - rate) / dt
            rate = steered_rate
        if arm_moves:
            if k > 0:
                lift, tilt = driven(lift, tilt, levers, k * dt < hold, dt, drive_share, machine.drive)
                pivot, pin = turned(pivot, lift.angle), turned(pin, tilt.angle - machine.bucket.carried)
            pose = pose_of(pivot, pin, machine.arm, machine.bucket)
            if k > 0:
                front = front_unit_in(pose, machine.payload, machine.frame, machine.arm, machine.bucket)
            arm = arm_forces(pose, lift, tilt, yaw + rate, machine.payload, machine.arm, machine.bucket)
        steering = Steering(
            joint, rate, change, speed, acceleration, gx, gy,
            arm.x * joint.sine + arm.y * joint.cosine, arm.yawing,
        )  # fmt: skip
        slide = lateral_step(
            drift, yaw, steering, front_load, rear_load, dt, front, machine.rear_unit, machine.wheel, geometry
        )  # fmt: skip
        loads = loads_of(
            acceleration - yaw * drift, slide.drift_change + yaw * speed, yaw, slide.yaw_change, joint, rate, change,
            Vector(gx, gy, start.gravity_z), front, machine.rear, machine.axle, geometry, arm,
        )  # fmt: skip
        drift, yaw = slide.drift, slide.yaw_rate
        # the roll mode answers to changes of the quasi-static support point
        if k > 0:
            offset -= loads.support.y - before
            support_rate += (-omega * omega * offset - damping * support_rate) * dt
            offset += support_rate * dt
        else:
            offset = within(start.support, ASIDE) - loads.support.y
        before = loads.support.y
        support = Support(loads.support.load, loads.support.x, loads.support.y + offset)
        forces = normal_forces(support, joint, loads.axle_load, loads.axle_moment, geometry)
        if arm_moves:
            if k == 0:
                bounce = bouncing(forces, front_load, rear_load, start.front_load_rate)
            else:
                bounce = bounced(bounce, forces, dt, machine)
            forces = with_bounce(forces, bounce)
        front_load = forces.front_left + forces.front_right
        rear_load = forces.rear_left + forces.rear_right
        now = margin(forces, machine.standing)
        if now.ratio < worst:
            worst, lifting = now.ratio, now.wheel
        if worst <= end:
            if worst <= 0.0:
                lift_off = k * dt
            break
        c, s = slight(yaw * dt)
        gx, gy = gx * c + gy * s, gy * c - gx * s
        joint = turned(joint, min(max(joint.angle + rate * dt, -stop), stop))
        faster = speed + acceleration * dt
        speed = faster if faster * speed > 0.0 else 0.0
        acceleration *= fade
    ratio = within(load_transfer_ratio(forces), -OVERTURNED)
    return Prediction(lift_off, max(worst, OVERTURNED), lifting, ratio)


class Bounce(NamedTuple):
    """How far the loads of the axles are from the quasi-static ones, and how fast that changes."""

    front: float  # [N]
    front_rate: float  # [N/s]
    rear: float
    rear_rate: float
    front_load: float  # the quasi-static ones of the step before [N]
    rear_load: float


STILL = Bounce(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""The tyres carry what rests on them."""


@inlined
def bouncing(forces: NormalForces, front: float, rear: float, front_rate: float) -> Bounce:
    """How the axles swing now; front, rear: their loads [N], beside the quasi-static `forces`; front_rate: of the front ones [N/s].

    Without the rate an arm that has just started looks as if the swing that it began were over.
    """
    ahead, behind = forces.front_left + forces.front_right, forces.rear_left + forces.rear_right
    return Bounce(front - ahead, front_rate, rear - behind, -front_rate, ahead, behind)


@inlined
def bounced(b: Bounce, forces: NormalForces, dt: float, m: LoadedMachine) -> Bounce:
    """The axles' loads `dt` [s] later, on tyres that give way: they follow the quasi-static `forces` as the pitch mode does.

    An arm that starts in a tenth of a second is faster than the tyres: they see part of the push, and swing after it.
    """
    ahead, behind = forces.front_left + forces.front_right, forces.rear_left + forces.rear_right
    square = m.pitch_frequency * m.pitch_frequency
    damping = 2.0 * m.prediction.roll_damping * m.pitch_frequency
    f, r = b.front - (ahead - b.front_load), b.rear - (behind - b.rear_load)
    front_rate = b.front_rate - (square * f + damping * b.front_rate) * dt
    rear_rate = b.rear_rate - (square * r + damping * b.rear_rate) * dt
    return Bounce(f + front_rate * dt, front_rate, r + rear_rate * dt, rear_rate, ahead, behind)


@inlined
def with_bounce(n: NormalForces, b: Bounce) -> NormalForces:
    """Both wheels of an axle swing alike."""
    front, rear = b.front / 2.0, b.rear / 2.0
    return NormalForces(
        n.front_left + front, n.front_right + front, n.pivot + b.rear, n.rear_left + rear, n.rear_right + rear
    )


@compiled
def with_demand(start: PredictionState, rate: float) -> PredictionState:
    """The same state with another demanded articulation rate [rad/s]."""
    return PredictionState(
        start.articulation_angle, start.articulation_rate, rate, start.speed, start.acceleration,
        start.gravity_x, start.gravity_y, start.gravity_z, start.ground, start.drift, start.yaw_rate,
        start.front_load, start.rear_load, start.support, start.support_rate, start.front_load_rate, start.levers,
    )  # fmt: skip


@compiled
def with_levers(start: PredictionState, levers: Levers) -> PredictionState:
    """The same state with other demands on lift arm and bucket."""
    return PredictionState(
        start.articulation_angle, start.articulation_rate, start.demanded_rate, start.speed, start.acceleration,
        start.gravity_x, start.gravity_y, start.gravity_z, start.ground, start.drift, start.yaw_rate,
        start.front_load, start.rear_load, start.support, start.support_rate, start.front_load_rate, levers,
    )  # fmt: skip
