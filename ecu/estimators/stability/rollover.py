"""Roll-over: load-transfer ratio, margin to lift-off, which wheel lifts first, and their prediction.

The prediction propagates articulation, speed, the slide of the tyres and the roll of the machine on its front
tyres over a horizon, so that a warning does not wait for the tilt that the thesis' estimator has to
see first (thesis 2.4.5, results 4.5.6). ISO 8855, joint origin, rear frame axes.
"""

import math
from typing import NamedTuple

from ecu.estimators.compiled import compiled
from ecu.estimators.loads.cog import with_axle
from ecu.estimators.loads.normal_force import Support, normal_forces
from ecu.estimators.motion.acceleration import joint_acceleration, planar_acceleration, yaw_rate
from ecu.estimators.motion.planar import Steering, lateral_step
from ecu.estimators.parameters import GRAVITY, Axle, Body, Geometry, Parameters, PredictionRules, Wheel
from ecu.estimators.quantities import NormalForces, Vector, WheelForces
from ecu.estimators.signals import NEVER
from ecu.estimators.stability.turning import lateral_forces


class Margin(NamedTuple):
    """Smallest normal force over its standing value, and its wheel (1 FL, 2 FR, 3 RL, 4 RR)."""

    ratio: float
    wheel: float


class Loads(NamedTuple):
    """Support point and what loads the rear axle, for one state of motion."""

    support: Support
    axle_load: float  # m_a f_z [N]
    axle_moment: float  # about the axle's contact line, loading the right wheel [N m]


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


class Prediction(NamedTuple):
    """What happens within the horizon, up to the moment when the margin is used up."""

    time_to_lift_off: float  # [s]; NEVER if no wheel lifts
    margin: float  # the smallest over the time looked at
    wheel: float  # the wheel of that margin (1..4)
    load_transfer_ratio: float  # at the end of that time


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
    roll_frequency: float  # on the front tyres [rad/s]


@compiled
def load_transfer_ratio(forces: NormalForces) -> float:
    """(right - left) / sum of the four normal forces; right side heavier +."""
    left = forces.front_left + forces.rear_left
    right = forces.front_right + forces.rear_right
    return (right - left) / (right + left)


@compiled
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


@compiled
def support_of(forces: NormalForces, articulation_angle: float, geometry: Geometry) -> Support:
    """Where the load on front wheels and pivot meets the ground."""
    c, s = math.cos(articulation_angle), math.sin(articulation_angle)
    lf, half = geometry.front_length, geometry.front_track / 2.0
    n1, n2 = forces.front_left, forces.front_right
    load = n1 + n2 + forces.pivot
    x = n1 * (lf * c - half * s) + n2 * (lf * c + half * s) - forces.pivot * geometry.rear_length
    y = n1 * (lf * s + half * c) + n2 * (lf * s - half * c)
    return Support(load, x / load, y / load)


@compiled
def loads_of(
    joint_x: float,
    joint_y: float,
    rate: float,
    change: float,
    articulation_angle: float,
    articulation_rate: float,
    articulation_acceleration: float,
    gravity: Vector,
    front: Body,
    rear: Body,
    axle: Axle,
    geometry: Geometry,
) -> Loads:
    """Support point of a machine that moves in the plane, quasi-static in roll and pitch.

    joint_x, joint_y: acceleration of the joint [m/s2]; rate, change: yaw of the rear frame [rad/s, rad/s2];
    gravity: specific force at rest on this ground [m/s2].
    """
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
def steady_rate(speed: float, articulation_angle: float, grip: float, geometry: Geometry) -> float:
    """Yaw rate [rad/s] of a steady turn.

    grip: largest lateral acceleration over gravity that the tyres can give; beyond it the machine turns less
    than its geometry says.
    """
    rate = yaw_rate(speed, articulation_angle, 0.0, geometry)
    most = grip * GRAVITY / max(abs(speed), 0.1)
    return min(max(rate, -most), most)


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

    gravity: specific force at rest on this ground [m/s2]; grip: as in `steady_rate`.
    """
    rate = steady_rate(speed, articulation_angle, grip, geometry)
    joint_x, joint_y = joint_acceleration(speed, 0.0, rate, 0.0, geometry)
    return loads_of(
        joint_x, joint_y, rate, 0.0, articulation_angle, 0.0, 0.0, gravity, front, rear, axle, geometry
    )


@compiled
def standing_forces(front: Body, rear: Body, axle: Axle, geometry: Geometry) -> NormalForces:
    """Normal forces of the straight machine at rest on level ground."""
    loads = steady_loads(0.0, 0.0, Vector(0.0, 0.0, GRAVITY), 0.0, front, rear, axle, geometry)
    return normal_forces(loads.support, 0.0, loads.axle_load, loads.axle_moment, geometry)


@compiled
def roll_frequency(front: Body, rear: Body, prediction: PredictionRules, geometry: Geometry) -> float:
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
def loaded_machine(front: Body, p: Parameters) -> LoadedMachine:
    """The machine with this front unit, and what follows from its loading."""
    g = p.geometry
    standing = standing_forces(front, p.rear, p.axle, g)
    frequency = roll_frequency(front, p.rear, p.prediction, g)
    unit = with_axle(p.rear, p.axle, g)
    return LoadedMachine(front, p.rear, unit, p.axle, p.wheel, g, p.prediction, standing, frequency)


@compiled
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
    """Margin and time to lift-off if the demanded rate lasts `hold` seconds and then ends.

    It looks no further than the moment when the margin falls to `floor`; 0 is lift-off.

    The articulation rate follows the demand as the steering can and fades before the stop; the
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
    stop = geometry.articulation_stop
    angle, rate = start.articulation_angle, start.articulation_rate
    speed, acceleration = start.speed, start.acceleration
    drift, yaw = start.drift, start.yaw_rate
    front_load, rear_load = start.front_load, start.rear_load
    gx, gy = start.gravity_x, start.gravity_y
    offset, support_rate, before = 0.0, start.support_rate, 0.0
    lift_off, worst, lifting, transfer = NEVER, 1e9, 0.0, 0.0
    for k in range(int(prediction.horizon / dt + 0.5) + 1):
        change = 0.0
        if k > 0:
            target = start.demanded_rate if k * dt < hold else 0.0
            steered_rate = steered(rate, target, angle, share, dt, geometry, prediction)
            change = (steered_rate - rate) / dt
            rate = steered_rate
        steering = Steering(angle, rate, change, speed, acceleration, gx, gy)
        slide = lateral_step(
            drift, yaw, steering, front_load, rear_load, dt, machine.front, machine.rear_unit, machine.wheel, geometry
        )  # fmt: skip
        loads = loads_of(
            acceleration - yaw * drift, slide.drift_change + yaw * speed, yaw, slide.yaw_change, angle, rate, change,
            Vector(gx, gy, start.gravity_z), machine.front, machine.rear, machine.axle, geometry,
        )  # fmt: skip
        drift, yaw = slide.drift, slide.yaw_rate
        # the roll mode answers to changes of the quasi-static support point
        if k > 0:
            offset -= loads.support.y - before
            support_rate += (-omega * omega * offset - damping * support_rate) * dt
            offset += support_rate * dt
        else:
            offset = start.support - loads.support.y
        before = loads.support.y
        support = Support(loads.support.load, loads.support.x, loads.support.y + offset)
        forces = normal_forces(support, angle, loads.axle_load, loads.axle_moment, geometry)
        front_load = forces.front_left + forces.front_right
        rear_load = forces.rear_left + forces.rear_right
        transfer = load_transfer_ratio(forces)
        now = margin(forces, machine.standing)
        if now.ratio < worst:
            worst, lifting = now.ratio, now.wheel
        if worst <= floor:
            if worst <= 0.0:
                lift_off = k * dt
            break
        turn = yaw * dt
        gx, gy = gx * math.cos(turn) + gy * math.sin(turn), gy * math.cos(turn) - gx * math.sin(turn)
        angle = min(max(angle + rate * dt, -stop), stop)
        faster = speed + acceleration * dt
        speed = faster if faster * speed > 0.0 else 0.0
        acceleration *= fade
    return Prediction(lift_off, worst, lifting, transfer)


@compiled
def with_demand(start: PredictionState, rate: float) -> PredictionState:
    """The same state with another demanded articulation rate [rad/s]."""
    return PredictionState(
        start.articulation_angle, start.articulation_rate, rate, start.speed, start.acceleration,
        start.gravity_x, start.gravity_y, start.gravity_z, start.ground, start.drift, start.yaw_rate,
        start.front_load, start.rear_load, start.support, start.support_rate,
    )  # fmt: skip
