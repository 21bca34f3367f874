"""One cycle of all corrected estimators: inputs and state in, estimates and new state out.

Two halves: `present` estimates the machine as it is now, `predict_and_permit` what follows within the horizon. Only the
first carries state, so that a study of a recording can leave out the prediction, which takes most of the time.
"""

import math
from typing import NamedTuple

from ecu.estimators.balance import balance, longitudinal_forces
from ecu.estimators.compiled import compiled
from ecu.estimators.inclination import Slope, without
from ecu.estimators.joint import Joint, joint_at
from ecu.estimators.loads.arm_forces import ArmForces, arm_forces
from ecu.estimators.loads.cog import Pose, front_unit_in, machine_centre, pose_at, product_of_inertia
from ecu.estimators.loads.doubt import Doubt, doubt_of
from ecu.estimators.loads.leaning import Leaning, leaning
from ecu.estimators.loads.payload import (
    BucketLoad,
    Residual,
    followed_load,
    lift_acceleration,
    push_of,
    residual,
)
from ecu.estimators.motion.acceleration import gravity_reaction, yaw_rate
from ecu.estimators.motion.arm import Turning, tracked
from ecu.estimators.motion.motion import (
    Accelerations,
    Motion,
    centre_force,
    fused_speed,
    kinematic_accelerations,
    lean_after,
    lean_before,
    measured_accelerations,
    motion,
)
from ecu.estimators.motion.planar import Steering, lateral_step
from ecu.estimators.motion.speed import Fused
from ecu.estimators.next_state import next_state
from ecu.estimators.parameters import GRAVITY, Body, Parameters
from ecu.estimators.quantities import NormalForces, Vector, WheelForces
from ecu.estimators.signals import Estimates, Inputs
from ecu.estimators.stability import (
    permitted,
    permitted_braking,
    permitted_levers,
    prediction,
    rollover,
    steady,
    turning,
)
from ecu.estimators.stability.levers import MOTIONS, Levers, demanded
from ecu.estimators.stability.prediction import Prediction
from ecu.estimators.stability.rollover import LoadedMachine, Margin
from ecu.estimators.stability.start import MOST, felt, within
from ecu.estimators.stability.step import PredictionState
from ecu.estimators.state import State
from ecu.estimators.tyres import contact
from ecu.estimators.tyres.contact import Followed, Tilt
from ecu.estimators.tyres.wheels import radius, shared, transient_forces, wheel_slips
from ecu.estimators.uncertainty import uncertainty


class Present(NamedTuple):
    """Estimates of this cycle, and the state from which the prediction starts."""

    normal: NormalForces
    forces: WheelForces
    slips: WheelForces
    models: WheelForces  # longitudinal force of the tyre model
    margin: Margin
    load_gap: float  # sum of the loads less what they have to carry [N]
    load_contradiction: float  # between the balance of forces and the gyro, as an angle of tilt [rad]
    yaw_moment: float
    joint_torque: float
    speed: Fused
    force: Vector  # specific force at the centre of gravity
    slope: Slope
    payload: float
    doubt: Doubt  # of payload and pile
    start: PredictionState
    motion: int  # of the levers, whose limit is looked for in this cycle
    machine: LoadedMachine


class Future(NamedTuple):
    """The prediction over its horizon, and the limits that follow from it."""

    prediction: Prediction
    permitted_rate: float  # articulation rate [rad/s]
    permitted_direction: float  # the demanded one: +1 left, -1 right, 0 none
    permitted_speed: float  # [m/s]
    permitted_lever: float  # [rad/s]
    permitted_motion: float


NOT_PREDICTED = Future(Prediction(*[math.nan] * 4), *[math.nan] * 5)
"""The prediction was left out."""


@compiled
def in_front_axes(joint: Joint, v: Vector) -> Vector:
    """A vector of the rear frame's axes in those of the front frame."""
    c, s = joint.cosine, joint.sine
    return Vector(v.x * c + v.y * s, v.y * c - v.x * s, v.z)


@compiled
def felt_by_load(
    i: Inputs, m: Motion, a: Accelerations, front: Body, pose: Pose, joint: Joint, p: Parameters
) -> tuple[Vector, Residual]:
    """Specific force where the load lies [m/s2, front frame's axes], and what the cylinders carry besides arm and bucket.

    Arm, bucket and load lie ahead of the front unit's centre of gravity: in a turn each is drawn inwards by its own distance from the joint.
    """
    front_yaw = m.rate.z + i.articulation_rate
    spin = front_yaw * front_yaw
    centre = in_front_axes(joint, a.front)
    ahead = pose.pin_x + pose.load_x  # of the arm's pivot
    felt = Vector(centre.x - spin * (p.arm.pivot_x + ahead - front.x), centre.y, centre.z)
    r = residual(i, felt.x, felt.z, p)
    nearer = p.arm.mass * pose.arm_z * spin * (ahead - pose.arm_x)
    return felt, Residual(r.weight + nearer, r.place, r.tilt_weight, r.tilt_place)


@compiled
def forces_of_arm(
    i: Inputs,
    m: Motion,
    pose: Pose,
    lift: Turning,
    tilt: Turning,
    payload: float,
    front: Body,
    joint: Joint,
    p: Parameters,
) -> ArmForces:
    """Of arm and bucket that move, and the moments of arm, bucket and load that lie ahead of the frame and not at its height as the unit turns."""
    yaw, turning_up = m.rate.z + i.articulation_rate, m.change.z + m.articulation_acceleration
    f = arm_forces(pose, lift, tilt, yaw, payload, p.arm, p.bucket)
    product = product_of_inertia(pose, payload, front, p.front, p.arm, p.bucket)
    rolling = joint.cosine * m.change.x + joint.sine * m.change.y
    return ArmForces(
        f.x, f.y, f.z,
        f.pitching + product * yaw * yaw, f.rolling - product * turning_up, f.yawing - product * rolling,
    )  # fmt: skip


@compiled
def bucket_load(
    i: Inputs,
    s: State,
    r: Residual,
    along: Vector,
    a: Accelerations,
    x: WheelForces,
    lean: Leaning,
    front: Body,
    lift: Turning,
    joint: Joint,
    p: Parameters,
) -> BucketLoad:
    """What the bucket carries and pushes, from the pressures and the traction that the motion does not explain."""
    traction = (x.x1 + x.x2) * joint.cosine + x.x3 + x.x4 + lean.along
    traction -= front.mass * a.front.x + p.rear.mass * a.rear.x + p.axle.mass * a.axle.x
    return followed_load(i, s, r, along, traction, s.speed, lift, p)


@compiled
def leaning_before(s: State, joint: Joint, p: Parameters) -> Leaning:
    """Of the loads and the tilt of the cycle before; nothing in the first one."""
    loads = NormalForces(s.normal_1, s.normal_2, 0.0, s.normal_3, s.normal_4)
    return leaning(loads, Tilt(s.roll_tilt, s.pitch_tilt), joint, p.geometry)


@compiled
def arm_motion(i: Inputs, s: State) -> tuple[Turning, Turning]:
    """Motion of lift arm and bucket; at rest in the first cycle."""
    if s.cycles == 0.0:
        return (
            Turning(i.lift_arm_angle, 0.0, 0.0, i.lift_arm_angle),
            Turning(i.tilt_angle, 0.0, 0.0, i.tilt_angle),
        )
    arm = Turning(s.lift_angle, s.lift_rate, s.lift_acceleration, s.lift_sample)
    bucket = Turning(s.tilt_angle, s.tilt_rate, s.tilt_acceleration, s.tilt_sample)
    return tracked(arm, i.lift_arm_angle, i.dt), tracked(bucket, i.tilt_angle, i.dt)


@compiled
def follow_tilt(
    i: Inputs, s: State, m: Motion, n: NormalForces, joint: Joint, p: Parameters
) -> tuple[NormalForces, Followed]:
    """Loads that follow the gyro in the short run, and the state of that filter.

    Where the gyro is not to be relied on, the balance of forces stands alone. Where a tyre has no load its deflection
    does not follow from its load: the balance gives the forces, and the tilt goes on with the gyro.
    """
    g, w = p.geometry, p.wheel
    bias = Tilt(s.roll_bias, s.pitch_bias)
    balanced = contact.tilt_of(n, joint, w, g)
    if s.cycles == 0.0 or i.rates_usable == 0.0 or p.contact.settling_time == 0.0:
        return n, Followed(balanced, bias, Tilt(0.0, 0.0), Tilt(0.0, 0.0))
    before, gyro = Tilt(s.roll_tilt, s.pitch_tilt), Tilt(i.roll_rate, i.pitch_rate)
    if not contact.stands(n):
        return n, contact.carried_on(before, bias, gyro, m.rate.z, i.dt)
    now = contact.followed(before, bias, gyro, m.rate.z, balanced, s.cycles, i.dt, p.contact)
    return contact.carried(n, now.tilt, now.rate, joint, i.dt, w, g, p.contact), now


@compiled
def present(i: Inputs, s: State, p: Parameters) -> tuple[Present, State]:
    """The estimates of this moment, and the state for the next cycle."""
    g, w, d = p.geometry, p.wheel, i.articulation_angle
    joint = joint_at(d)
    m = motion(i, s, p)
    r3 = radius((s.normal_3 + s.normal_4) / 2.0, w.rear_stiffening, w)
    axle_speed = (i.wheel_speed_3 + i.wheel_speed_4) / 2.0 * r3
    lean = lean_before(s, m, axle_speed)
    slope = without(Slope(i.pitch, i.roll), lean)
    pose = pose_at(i.lift_arm_angle, i.tilt_angle, p.arm, p.bucket)
    front = front_unit_in(pose, s.payload, p.front, p.arm, p.bucket)
    if i.acceleration_usable != 0.0:
        a = measured_accelerations(i, m, front, p)
    else:
        a = kinematic_accelerations(i, s, m, slope, front, p)
    lean_of_loads = leaning_before(s, joint, p)
    x = longitudinal_forces(i, s, m, a, lean_of_loads, front, p)
    arm, bucket = arm_motion(i, s)
    along, moments = felt_by_load(i, m, a, front, pose, joint, p)
    load = bucket_load(i, s, moments, along, a, x, lean_of_loads, front, arm, joint, p)
    front = front_unit_in(pose, load.payload, p.front, p.arm, p.bucket)
    machine = rollover.loaded_machine(front, load.payload, p)

    r1 = radius(s.normal_1, w.front_stiffening, w)
    r2 = radius(s.normal_2, w.front_stiffening, w)
    fused = fused_speed(i, s, m, a.axle, slope, Vector(r1, r2, r3), p)
    v = fused.speed
    led = lean_after(i, s, m, lean, slope, v, axle_speed, p)
    axle_acceleration = (m.wheel_acceleration_3 + m.wheel_acceleration_4) / 2.0 * r3
    trail = w.pneumatic_trail * min(max(v / 0.5, -1.0), 1.0)

    quick = Turning(arm.angle, arm.rate, lift_acceleration(i, moments, along, load, arm, p), arm.sample)
    pose = pose_at(quick.angle, bucket.angle, p.arm, p.bucket)  # the tracked one, whose motion it is
    moved = forces_of_arm(i, m, pose, quick, bucket, load.payload, front, joint, p)
    push = push_of(i, load, p)
    doubt = doubt_of(i, moments, along, load, push, arm, pose, p)
    balanced = balance(i, m, a, front, push, moved, x, trail, lean_of_loads, joint, p)
    lateral = balanced.lateral
    n, tilt = follow_tilt(i, s, m, balanced.normal, joint, p)

    rest = felt(Vector(a.rear.x, a.rear.y, a.rear.z))
    if i.slope_usable != 0.0:
        rest = gravity_reaction(slope.pitch, slope.roll, GRAVITY)
    acceleration = within(a.axle.x - rest.x if i.acceleration_usable != 0.0 else axle_acceleration, MOST)
    front_load, rear_load = n.front_left + n.front_right, n.rear_left + n.rear_right
    gap = front_load + rear_load - balanced.carried
    contradiction = max(abs(tilt.innovation.roll), abs(tilt.innovation.pitch))
    steering = Steering(
        joint, i.articulation_rate, m.articulation_acceleration, v, acceleration, rest.x, rest.y,
        moved.x * joint.sine + moved.y * joint.cosine, moved.yawing,
    )  # fmt: skip
    slide = lateral_step(
        s.drift, m.rate.z, steering, front_load, rear_load, i.dt, front, machine.rear_unit, w, g
    )
    ground = steady.leaned(rest, Tilt(-tilt.tilt.roll, -tilt.tilt.pitch))
    left_rate, right_rate = contact.load_rates(n, tilt.rate, joint, w, g)
    demand = i.articulation_rate_demand if i.demand_usable != 0.0 else i.articulation_rate
    start = PredictionState(
        d, i.articulation_rate, demand, v, acceleration, rest.x, rest.y, rest.z, ground, slide.drift,
        m.rate.z, n.front_left, n.front_right, rear_load, left_rate, right_rate, lever_demands(i, arm, bucket, p),
    )  # fmt: skip

    slips = wheel_slips(i, m.rate.z, v, slide.drift - g.rear_length * m.rate.z, n, w, g)
    y1, y2 = shared(lateral.front, n.front_left, n.front_right, slips.y1, slips.y2, w)
    y3, y4 = shared(lateral.rear, n.rear_left, n.rear_right, slips.y3, slips.y4, w)
    forces = WheelForces(x.x1, x.x2, x.x3, x.x4, y1, y2, y3, y4)
    deflections, models = transient_forces(s, slips, v, n, i.dt, w, p.magic_formula)

    whole = machine_centre(d, front, machine.rear_unit)
    turn = turning.yaw_moment(forces, whole.x, whole.y, d, g) - trail * (lateral.front + lateral.rear)
    now = Present(
        n, forces, slips, models,
        rollover.margin(n, machine.standing), gap, contradiction, turn, lateral.joint_torque, fused,
        centre_force(a, front, p.rear, p.axle.mass), slope, load.payload, doubt, start, int(s.cycles) % MOTIONS, machine,
    )  # fmt: skip
    state = next_state(
        i, s, m, load, fused, axle_speed, axle_acceleration, n, forces,
        deflections, slide.drift, tilt.tilt, tilt.bias, led, lateral.front, arm, bucket,
    )  # fmt: skip
    return now, state


@compiled
def lever_demands(i: Inputs, arm: Turning, bucket: Turning, p: Parameters) -> Levers:
    """Angles and rates of lift arm and bucket, with the rates that the driver demands within the present limits.

    Where the demand is not known, the present rates stand for it.
    """
    drive = p.linkage_drive
    if i.demand_usable == 0.0:
        return Levers(arm.angle, arm.rate, arm.rate, bucket.angle, bucket.rate, bucket.rate)
    lift = demanded(i.lift_demand, drive.lift_up, drive.lift_down, i.lift_up_limit, i.lift_down_limit)
    tilt = demanded(
        i.tilt_demand, drive.tilt_back, drive.tilt_forward, i.tilt_back_limit, i.tilt_forward_limit
    )
    return Levers(arm.angle, arm.rate, lift, bucket.angle, bucket.rate, tilt)


@compiled
def predict_and_permit(
    start: PredictionState, motion: int, rate_limit: float, machine: LoadedMachine
) -> Future:
    """The prediction at the rates that the driver demands and is permitted, and what will be permitted next.

    motion: of the levers, the one whose limit is looked for.
    """
    asked = asked_of(start, rate_limit)
    ahead = prediction.predict(asked, machine.prediction.demand_hold, 0.0, machine)
    return Future(
        ahead,
        permitted.permitted_rate(start, machine),
        asked_direction(start),
        speed_limit(asked, machine),
        permitted_levers.permitted_lever(asked, motion, ahead.margin, machine),
        float(motion),
    )


@compiled
def asked_of(start: PredictionState, rate_limit: float) -> PredictionState:
    """The start with the articulation rate that is demanded and permitted [rad/s]."""
    return prediction.with_demand(start, min(max(start.demanded_rate, -rate_limit), rate_limit))


@compiled
def asked_direction(start: PredictionState) -> float:
    """The direction that is demanded: +1 left, -1 right, 0 none."""
    return math.copysign(1.0, start.demanded_rate) if start.demanded_rate != 0.0 else 0.0


@compiled
def speed_limit(start: PredictionState, machine: LoadedMachine) -> float:
    """Limit of the speed [m/s] for the turn that the present articulation rate leads to; start: with the rate that is demanded and permitted."""
    direction = travel(start)
    speed = permitted.permitted_speed(turn_ahead(start, machine), start.ground, direction, machine)
    limit = permitted.limit_for(speed, start.ground, direction, machine)
    return permitted_braking.gentle(limit, start, machine)


@compiled
def turn_ahead(start: PredictionState, machine: LoadedMachine) -> float:
    """Articulation angle [rad] that the present rate leads to."""
    return permitted.turned_to(start, start.articulation_rate, machine)


@compiled
def travel(start: PredictionState) -> float:
    """+1 forward, -1 reverse."""
    return 1.0 if start.speed >= 0.0 else -1.0


@compiled
def estimates_of(now: Present, future: Future, p: Parameters) -> Estimates:
    """Both halves as one row of estimates."""
    c = now.start
    sure = uncertainty(
        now.force,
        c.articulation_angle,
        c.articulation_rate,
        c.levers.lift_angle,
        now.payload,
        now.normal,
        now.doubt,
        p,
    )
    return Estimates(
        normal_1=now.normal.front_left,
        normal_2=now.normal.front_right,
        normal_3=now.normal.rear_left,
        normal_4=now.normal.rear_right,
        longitudinal_1=now.forces.x1,
        longitudinal_2=now.forces.x2,
        longitudinal_3=now.forces.x3,
        longitudinal_4=now.forces.x4,
        lateral_1=now.forces.y1,
        lateral_2=now.forces.y2,
        lateral_3=now.forces.y3,
        lateral_4=now.forces.y4,
        slip_1=now.slips.x1,
        slip_2=now.slips.x2,
        slip_3=now.slips.x3,
        slip_4=now.slips.x4,
        tyre_model_1=now.models.x1,
        tyre_model_2=now.models.x2,
        tyre_model_3=now.models.x3,
        tyre_model_4=now.models.x4,
        load_transfer_ratio=rollover.load_transfer_ratio(now.normal),
        front_load_transfer_ratio=rollover.front_load_transfer_ratio(now.normal),
        predicted_load_transfer_ratio=future.prediction.load_transfer_ratio,
        lift_off_margin=now.margin.ratio,
        lift_off_wheel=now.margin.wheel,
        predicted_margin=future.prediction.margin,
        time_to_lift_off=future.prediction.time_to_lift_off,
        lifting_wheel=future.prediction.wheel,
        yaw_moment=now.yaw_moment,
        joint_torque=now.joint_torque,
        yaw_rate=yaw_rate(now.speed.speed, c.articulation_angle, c.articulation_rate, p.geometry),
        speed=now.speed.speed,
        specific_force_x=now.force.x,
        specific_force_y=now.force.y,
        specific_force_z=now.force.z,
        slope_pitch=now.slope.pitch,
        slope_roll=now.slope.roll,
        payload=now.payload,
        permitted_rate=future.permitted_rate,
        permitted_direction=future.permitted_direction,
        permitted_speed=future.permitted_speed,
        permitted_lever=future.permitted_lever,
        permitted_motion=future.permitted_motion,
        load_gap=now.load_gap,
        load_contradiction=now.load_contradiction,
        speed_doubt=now.speed.doubt,
        normal_1_sd=sure.normal_1,
        normal_2_sd=sure.normal_2,
        normal_3_sd=sure.normal_3,
        normal_4_sd=sure.normal_4,
        load_transfer_ratio_sd=sure.load_transfer_ratio,
        payload_sd=sure.payload,
    )


@compiled
def corrected(i: Inputs, s: State, p: Parameters) -> tuple[Estimates, State]:
    """One cycle of the corrected estimators."""
    now, state = present(i, s, p)
    return estimates_of(now, predict_and_permit(now.start, now.motion, i.rate_limit, now.machine), p), state


@compiled
def corrected_now(i: Inputs, s: State, p: Parameters) -> tuple[Estimates, State]:
    """One cycle without the prediction: predicted values are NaN."""
    now, state = present(i, s, p)
    return estimates_of(now, NOT_PREDICTED, p), state
