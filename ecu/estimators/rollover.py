"""Roll-over: load transfer, margin to lift-off, which wheel first, and the outlook ahead.

The outlook propagates articulation angle, its rate, speed and the roll of the machine on its front
tyres over a horizon, so that a warning does not wait for the tilt that the thesis' estimator has to
see first (thesis 2.4.5, results 4.5.6). ISO 8855, joint origin, rear frame axes.
"""

import math
from typing import NamedTuple

from ecu.estimators.acceleration import (
    Vector,
    joint_acceleration,
    planar_acceleration,
    yaw_acceleration,
    yaw_rate,
)
from ecu.estimators.compiled import compiled
from ecu.estimators.normal_force import NormalForces, Support, normal_forces
from ecu.estimators.parameters import GRAVITY, Axle, Body, Geometry, Prediction
from ecu.estimators.turning import WheelForces, lateral_forces

NEVER = 10.23  # TimeToLiftOff of the DBC: none within the horizon [s]


class Margin(NamedTuple):
    """Smallest normal force over its standing value, and its wheel (1 FL, 2 FR, 3 RL, 4 RR)."""

    ratio: float
    wheel: float


class Loads(NamedTuple):
    """Support point and what loads the rear axle, for one state of motion."""

    support: Support
    axle_load: float  # m_a f_z [N]
    axle_moment: float  # about the axle's contact line, loading the right wheel [N m]


class Course(NamedTuple):
    """Where the machine stands and what is asked of it, at the beginning of an outlook."""

    articulation_angle: float
    articulation_rate: float
    demanded_rate: float
    speed: float
    acceleration: float
    gravity_x: float  # specific force of rest on this ground, rear axes [m/s2]
    gravity_y: float
    gravity_z: float
    roll_offset: float  # present support point minus the quasi-static one, along y [m]
    roll_offset_rate: float  # [m/s]


class Outlook(NamedTuple):
    """What the horizon brings."""

    time_to_lift_off: float  # [s]; NEVER if no wheel lifts
    margin: float  # smallest within the horizon
    wheel: float  # the wheel of that margin, or the first to lift (1..4)
    load_transfer_ratio: float  # at the end


@compiled
def load_transfer_ratio(forces: NormalForces) -> float:
    """(right - left) / sum of the four normal forces; right side heavier +."""
    left = forces.front_left + forces.rear_left
    right = forces.front_right + forces.rear_right
    return (right - left) / (right + left)


@compiled
def margin(forces: NormalForces, standing: NormalForces) -> Margin:
    """Smallest of the four forces relative to the machine standing on level ground in the same pose."""
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


@compiled
def planar_loads(
    speed: float,
    acceleration: float,
    articulation_angle: float,
    articulation_rate: float,
    articulation_acceleration: float,
    gravity: Vector,
    front: Body,
    rear: Body,
    axle: Axle,
    geometry: Geometry,
) -> Loads:
    """Support point of the rolling machine without lateral slip, quasi-static in roll and pitch.

    gravity: specific force at rest on this ground [m/s2].
    """
    rate = yaw_rate(speed, articulation_angle, articulation_rate, geometry)
    change = yaw_acceleration(
        speed, acceleration, articulation_angle, articulation_rate, articulation_acceleration, geometry
    )
    joint_x, joint_y = joint_acceleration(speed, acceleration, rate, change, geometry)
    c, s = math.cos(articulation_angle), math.sin(articulation_angle)
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

    push = (front_force.x + rear_force.x + axle_x) / (2.0 + 2.0 * c)
    front_moment = front.x * (c * front_force.y - s * front_force.x) + front.yaw_inertia * front_change
    moment = front_moment + rear.x * rear_force.y + rear.yaw_inertia * change - geometry.rear_length * axle_y
    lateral = lateral_forces(
        front_force.y + rear_force.y + axle_y, moment, front_moment,
        WheelForces(push, push, push, push, 0.0, 0.0, 0.0, 0.0), 0.0, articulation_angle, geometry,
    )  # fmt: skip
    pivot_side = lateral.rear - axle_y
    load = front_force.z + rear_force.z
    x = xf * front_force.z + rear.x * rear_force.z - front.z * front_force.x - rear.z * rear_force.x
    y = yf * front_force.z - front.z * front_force.y - rear.z * rear_force.y
    support = Support(
        load, (x - axle.height * axle_x) / load, (y + geometry.pivot_height * pivot_side) / load
    )
    axle_moment = geometry.pivot_height * pivot_side + axle.height * axle_y
    return Loads(support, axle.mass * gravity.z, axle_moment)


@compiled
def standing_forces(
    articulation_angle: float, front: Body, rear: Body, axle: Axle, geometry: Geometry
) -> NormalForces:
    """Normal forces of the machine at rest on level ground."""
    loads = planar_loads(
        0.0, 0.0, articulation_angle, 0.0, 0.0, Vector(0.0, 0.0, GRAVITY), front, rear, axle, geometry
    )
    return normal_forces(loads.support, articulation_angle, loads.axle_load, loads.axle_moment, geometry)


@compiled
def roll_frequency(front: Body, rear: Body, prediction: Prediction, geometry: Geometry) -> float:
    """Natural frequency of the roll on the front tyres [rad/s].

    The machine turns about the line from the front axle's ground contact to the oscillation pivot.
    """
    slope = geometry.pivot_height / (geometry.front_length + geometry.rear_length)
    above_front = front.z - slope * (geometry.front_length - front.x)
    above_rear = rear.z - slope * (geometry.front_length - rear.x)
    inertia = front.roll_inertia + rear.roll_inertia
    inertia += front.mass * above_front * above_front + rear.mass * above_rear * above_rear
    weight = GRAVITY * (front.mass * above_front + rear.mass * above_rear)
    half = geometry.front_track / 2.0
    return math.sqrt((2.0 * prediction.tyre_stiffness * half * half - weight) / inertia)


@compiled
def look_ahead(
    course: Course,
    hold: float,
    front: Body,
    rear: Body,
    axle: Axle,
    geometry: Geometry,
    prediction: Prediction,
) -> Outlook:
    """Margin and time to lift-off if the demanded rate lasts `hold` seconds and then ends.

    The articulation rate follows the demand with the steering's lag and ends at the stop; the
    longitudinal acceleration fades; the support point follows the quasi-static one as a lightly
    damped roll mode does, overshoot included. The ground keeps its slope while the machine turns on it.
    """
    dt = prediction.step
    steps = int(prediction.horizon / dt + 0.5)
    follow = 1.0 - math.exp(-dt / prediction.steering_lag)
    fade = math.exp(-dt / prediction.acceleration_memory)
    omega = roll_frequency(front, rear, prediction, geometry)
    damping = 2.0 * prediction.roll_damping * omega
    angle, rate = course.articulation_angle, course.articulation_rate
    speed, acceleration = course.speed, course.acceleration
    gx, gy = course.gravity_x, course.gravity_y
    stop = geometry.articulation_stop
    offset, offset_rate, before = course.roll_offset, course.roll_offset_rate, 0.0
    lift_off, worst, wheel, transfer = NEVER, 1e9, 0.0, 0.0
    for k in range(steps + 1):
        time = k * dt
        target = course.demanded_rate if time < hold else 0.0
        if (angle >= stop and target > 0.0) or (angle <= -stop and target < 0.0):
            target = 0.0
        new_rate = rate + (target - rate) * follow if k > 0 else rate
        change = (new_rate - rate) / dt
        rate = new_rate
        loads = planar_loads(
            speed,
            acceleration,
            angle,
            rate,
            change,
            Vector(gx, gy, course.gravity_z),
            front,
            rear,
            axle,
            geometry,
        )
        # the roll mode answers to changes of the quasi-static support point
        if k > 0:
            offset -= loads.support.y - before
            offset_rate += (-omega * omega * offset - damping * offset_rate) * dt
            offset += offset_rate * dt
        before = loads.support.y
        support = Support(loads.support.load, loads.support.x, loads.support.y + offset)
        forces = normal_forces(support, angle, loads.axle_load, loads.axle_moment, geometry)
        standing = standing_forces(angle, front, rear, axle, geometry)
        now = margin(forces, standing)
        transfer = load_transfer_ratio(forces)
        if now.ratio <= 0.0 and lift_off == NEVER:
            lift_off = time
            wheel = now.wheel
        if now.ratio < worst:
            worst = now.ratio
            if lift_off == NEVER:
                wheel = now.wheel
        turn = yaw_rate(speed, angle, rate, geometry) * dt
        gx, gy = gx * math.cos(turn) + gy * math.sin(turn), gy * math.cos(turn) - gx * math.sin(turn)
        angle = min(max(angle + rate * dt, -stop), stop)
        if abs(angle) >= stop and rate * angle > 0.0:
            rate = 0.0
        faster = speed + acceleration * dt
        speed = faster if faster * speed > 0.0 else 0.0
        acceleration *= fade
    return Outlook(lift_off, worst, wheel, transfer)


@compiled
def permitted_rate(
    course: Course, front: Body, rear: Body, axle: Axle, geometry: Geometry, prediction: Prediction
) -> float:
    """Largest articulation rate [rad/s] in the demanded direction that keeps the predicted margin.

    Without a demand the direction that tightens the turn is taken. 0 where even holding the angle
    violates `margin_floor`.
    """
    tighten = course.articulation_angle >= 0.0
    direction = 1.0 if course.demanded_rate > 0.0 or (course.demanded_rate == 0.0 and tighten) else -1.0
    low, high = 0.0, prediction.largest_rate
    for k in range(7):
        trial = high if k == 0 else (low + high) / 2.0
        attempt = Course(
            course.articulation_angle, course.articulation_rate, direction * trial, course.speed, course.acceleration,
            course.gravity_x, course.gravity_y, course.gravity_z, course.roll_offset, course.roll_offset_rate,
        )  # fmt: skip
        outlook = look_ahead(attempt, prediction.limit_hold, front, rear, axle, geometry, prediction)
        if outlook.margin >= prediction.margin_floor:
            if k == 0:
                return trial
            low = trial
        else:
            high = trial
    return low


@compiled
def permitted_speed(
    articulation_angle: float,
    gravity: Vector,
    direction: float,
    front: Body,
    rear: Body,
    axle: Axle,
    geometry: Geometry,
    prediction: Prediction,
) -> float:
    """Largest speed [m/s] at which a steady turn at this angle keeps the margin `speed_floor`.

    direction: +1 forward, -1 reverse. 0 where the machine would not keep it standing.
    """
    standing = standing_forces(articulation_angle, front, rear, axle, geometry)
    low, high = 0.0, prediction.largest_speed
    for k in range(9):
        trial = high if k == 0 else (low + high) / 2.0
        loads = planar_loads(
            direction * trial, 0.0, articulation_angle, 0.0, 0.0, gravity, front, rear, axle, geometry
        )
        forces = normal_forces(
            loads.support, articulation_angle, loads.axle_load, loads.axle_moment, geometry
        )
        if margin(forces, standing).ratio >= prediction.speed_floor:
            if k == 0:
                return trial
            low = trial
        else:
            high = trial
    return low
