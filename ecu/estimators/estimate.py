"""One cycle of all estimators, corrected: inputs and state in, estimates and new state out.

Two halves: `present` is what is so now, `ahead` what will come of it. Only the first carries state, so
that whoever does not need the outlook of a recording can leave it out.
"""

import math
from typing import NamedTuple

from ecu.estimators import contact, permitted, rollover, turning
from ecu.estimators.acceleration import Vector, gravity_reaction, yaw_rate
from ecu.estimators.balance import balance, longitudinal_forces
from ecu.estimators.cog import front_unit, machine_centre
from ecu.estimators.compiled import compiled
from ecu.estimators.contact import Followed, Tilt
from ecu.estimators.motion import (
    Accelerations,
    Motion,
    centre_force,
    fused_speed,
    kinematic_accelerations,
    measured_accelerations,
    motion,
)
from ecu.estimators.normal_force import NormalForces
from ecu.estimators.parameters import GRAVITY, Body, Parameters
from ecu.estimators.payload import BucketLoad, followed_load, push_of
from ecu.estimators.planar import Steering, slid
from ecu.estimators.rollover import Course, Laden, Margin, Outlook
from ecu.estimators.signals import Estimates, Inputs, State
from ecu.estimators.state import next_state
from ecu.estimators.turning import WheelForces
from ecu.estimators.wheels import radius, shared, transient_forces, wheel_slips


class Present(NamedTuple):
    """What is so now, and where an outlook starts."""

    normal: NormalForces
    forces: WheelForces
    slips: WheelForces
    models: WheelForces  # longitudinal force of the tyre model
    margin: Margin
    yaw_moment: float
    joint_torque: float
    speed: float
    force: Vector  # specific force at the centre of gravity
    payload: float
    course: Course
    machine: Laden


class Ahead(NamedTuple):
    """What will come of it."""

    outlook: Outlook
    permitted_rate: float
    permitted_speed: float


UNKNOWN = Ahead(Outlook(math.nan, math.nan, math.nan, math.nan), math.nan, math.nan)
"""Nobody looked."""


@compiled
def bucket_load(
    i: Inputs, s: State, a: Accelerations, x: WheelForces, front: Body, p: Parameters
) -> BucketLoad:
    """What the bucket carries and pushes, from the pressures and the traction that the motion does not explain."""
    c, d = math.cos(i.articulation_angle), math.sin(i.articulation_angle)
    along = Vector(a.front.x * c + a.front.y * d, a.front.y * c - a.front.x * d, a.front.z)
    traction = (x.x1 + x.x2) * c + x.x3 + x.x4
    traction -= front.mass * a.front.x + p.rear.mass * a.rear.x + p.axle.mass * a.axle.x
    return followed_load(i, s, along, traction, s.speed, p)


@compiled
def follow_tilt(
    i: Inputs, s: State, m: Motion, n: NormalForces, p: Parameters
) -> tuple[NormalForces, Followed]:
    """Loads that follow the gyro in the short run, and the state of that filter.

    Where a tyre has no load or the gyro is not to be relied on, the balance of forces stands.
    """
    g, w = p.geometry, p.wheel
    bias = Tilt(s.roll_bias, s.pitch_bias)
    balanced = contact.tilt_of(n, i.articulation_angle, w, g)
    if s.cycles == 0.0 or i.rates_usable == 0.0 or not contact.stands(n) or p.contact.settling_time == 0.0:
        return n, Followed(balanced, bias, Tilt(0.0, 0.0))
    before, gyro = Tilt(s.roll_tilt, s.pitch_tilt), Tilt(i.roll_rate, i.pitch_rate)
    now = contact.followed(before, bias, gyro, m.rate.z, balanced, s.cycles, i.dt, p.contact)
    return contact.carried(n, now.tilt, now.rate, i.articulation_angle, i.dt, w, g, p.contact), now


@compiled
def present(i: Inputs, s: State, p: Parameters) -> tuple[Present, State]:
    """The estimates of this moment, and the state for the next cycle."""
    g, w, d = p.geometry, p.wheel, i.articulation_angle
    m = motion(i, s, p)
    front = front_unit(i.lift_arm_angle, i.tilt_angle, s.payload, p.front, p.arm, p.bucket)
    if i.acceleration_usable != 0.0:
        a = measured_accelerations(i, m, front, p)
    else:
        a = kinematic_accelerations(i, s, m, front, p)
    x = longitudinal_forces(i, s, m, a, front, p)
    load = bucket_load(i, s, a, x, front, p)
    front = front_unit(i.lift_arm_angle, i.tilt_angle, load.payload, p.front, p.arm, p.bucket)
    machine = rollover.laden(front, p)

    r1 = radius(s.normal_1, w.front_stiffening, w)
    r2 = radius(s.normal_2, w.front_stiffening, w)
    r3 = radius((s.normal_3 + s.normal_4) / 2.0, w.rear_stiffening, w)
    v = fused_speed(i, s, m, a.axle, Vector(r1, r2, r3), p)
    axle_speed = (i.wheel_speed_3 + i.wheel_speed_4) / 2.0 * r3
    axle_acceleration = (m.wheel_acceleration_3 + m.wheel_acceleration_4) / 2.0 * r3
    trail = w.pneumatic_trail * min(max(v / 0.5, -1.0), 1.0)

    lateral, balanced = balance(i, m, a, front, push_of(i, load, p), x, trail, p)
    n, tilt = follow_tilt(i, s, m, balanced, p)

    rest = Vector(a.rear.x, a.rear.y, a.rear.z)
    if i.slope_usable != 0.0:
        rest = gravity_reaction(i.pitch, i.roll, GRAVITY)
    acceleration = (a.axle.x - rest.x) if i.acceleration_usable != 0.0 else axle_acceleration
    front_load, rear_load = n.front_left + n.front_right, n.rear_left + n.rear_right
    steering = Steering(d, i.articulation_rate, m.articulation_acceleration, v, acceleration, rest.x, rest.y)
    slide = slid(s.drift, m.rate.z, steering, front_load, rear_load, i.dt, front, machine.rear_unit, w, g)
    ground = permitted.leaned(rest, Tilt(-tilt.tilt.roll, -tilt.tilt.pitch))
    over = rollover.support_of(n, d, g)
    demand = i.articulation_rate_demand if i.demand_usable != 0.0 else i.articulation_rate
    course = Course(
        d, i.articulation_rate, demand, v, acceleration, rest.x, rest.y, rest.z, ground, slide.drift,
        m.rate.z, front_load, rear_load, over.y, contact.support_rate(n, tilt.rate, d, i.articulation_rate, w, g),
    )  # fmt: skip

    y1, y2 = shared(lateral.front, n.front_left, n.front_right)
    y3, y4 = shared(lateral.rear, n.rear_left, n.rear_right)
    forces = WheelForces(x.x1, x.x2, x.x3, x.x4, y1, y2, y3, y4)
    slips = wheel_slips(i, m.rate.z, v, slide.drift - g.rear_length * m.rate.z, n, w, g)
    deflections, models = transient_forces(s, slips, v, n, i.dt, w, p.magic_formula)

    whole = machine_centre(d, front, machine.rear_unit)
    turn = turning.yaw_moment(forces, whole.x, whole.y, d, g) - trail * (lateral.front + lateral.rear)
    now = Present(
        n, forces, slips, models,
        rollover.margin(n, machine.standing), turn, lateral.joint_torque, v,
        centre_force(a, front, p.rear, p.axle.mass), load.payload, course, machine,
    )  # fmt: skip
    state = next_state(
        i, s, m, load, v, axle_speed, axle_acceleration, n, forces,
        deflections, slide.drift, tilt.tilt, tilt.bias,
    )  # fmt: skip
    return now, state


@compiled
def ahead(course: Course, rate_limit: float, machine: Laden) -> Ahead:
    """The outlook at the rate that the driver demands and is permitted, and what would be permitted."""
    g, prediction, rate = machine.geometry, machine.prediction, course.articulation_rate
    asked = rollover.demanding(course, min(max(course.demanded_rate, -rate_limit), rate_limit))
    outlook = rollover.look_ahead(asked, prediction.demand_hold, 0.0, machine)
    turned = course.articulation_angle + rate * prediction.limit_hold
    turned = min(max(turned, -g.articulation_stop), g.articulation_stop)
    direction = 1.0 if course.speed >= 0.0 else -1.0
    speed = permitted.permitted_speed(turned, course.ground, direction, machine)
    return Ahead(
        outlook,
        permitted.permitted_rate(course, machine),
        permitted.limit_for(speed, course.ground, direction, machine),
    )


@compiled
def estimates_of(now: Present, future: Ahead, p: Parameters) -> Estimates:
    """Both halves in the order of the estimates."""
    n, f, k, t, outlook = now.normal, now.forces, now.slips, now.models, future.outlook
    c = now.course
    return Estimates(
        n.front_left, n.front_right, n.rear_left, n.rear_right,
        f.x1, f.x2, f.x3, f.x4, f.y1, f.y2, f.y3, f.y4, k.x1, k.x2, k.x3, k.x4, t.x1, t.x2, t.x3, t.x4,
        rollover.load_transfer_ratio(n), outlook.load_transfer_ratio, now.margin.ratio, now.margin.wheel,
        outlook.margin, outlook.time_to_lift_off, outlook.wheel, now.yaw_moment, now.joint_torque,
        yaw_rate(now.speed, c.articulation_angle, c.articulation_rate, p.geometry), now.speed,
        now.force.x, now.force.y, now.force.z, now.payload, future.permitted_rate, future.permitted_speed,
    )  # fmt: skip


@compiled
def corrected(i: Inputs, s: State, p: Parameters) -> tuple[Estimates, State]:
    """One cycle of the corrected estimators."""
    now, state = present(i, s, p)
    return estimates_of(now, ahead(now.course, i.rate_limit, now.machine), p), state


@compiled
def corrected_now(i: Inputs, s: State, p: Parameters) -> tuple[Estimates, State]:
    """The same without the outlook: what belongs to it is not a number."""
    now, state = present(i, s, p)
    return estimates_of(now, UNKNOWN, p), state
