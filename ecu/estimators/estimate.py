"""One cycle of all estimators: inputs and state in, estimates and new state out.

Everything here is a float: flags are 0 or 1, wheels are 1 FL, 2 FR, 3 RL, 4 RR. An input that is not
usable still needs a number (its last one); its flag says that it is not to be relied on, and what can
do without it does. Which estimate may then be called valid is decided in `ecu.validity`.
"""

import math
from typing import NamedTuple

from ecu.estimators import contact, normal_force, rollover, speed, turning, tyre
from ecu.estimators.acceleration import (
    Vector,
    gravity_reaction,
    joint_acceleration,
    planar_acceleration,
    printed_acceleration,
    transported,
    yaw_acceleration,
    yaw_rate,
)
from ecu.estimators.cog import front_unit, front_unit_printed, machine_centre
from ecu.estimators.compiled import compiled
from ecu.estimators.contact import Followed, Tilt
from ecu.estimators.normal_force import NormalForces, Support
from ecu.estimators.parameters import GRAVITY, Body, Parameters, Wheel
from ecu.estimators.payload import payload
from ecu.estimators.planar import Steering, slid
from ecu.estimators.rollover import NEVER, Course
from ecu.estimators.turning import WheelForces


class Inputs(NamedTuple):
    """What the machine reports, SI, and which of it is usable (1) or not (0)."""

    dt: float  # time since the previous cycle [s]
    articulation_angle: float
    articulation_rate: float
    articulation_rate_demand: float
    wheel_speed_1: float
    wheel_speed_2: float
    wheel_speed_3: float
    wheel_speed_4: float
    wheel_torque_1: float
    wheel_torque_2: float
    wheel_torque_3: float
    wheel_torque_4: float
    specific_force_x: float
    specific_force_y: float
    specific_force_z: float
    roll_rate: float
    pitch_rate: float
    yaw_rate: float
    pitch: float
    roll: float
    lift_pressure: float
    tilt_pressure: float
    lift_arm_angle: float
    tilt_angle: float
    demand_usable: float
    wheel_1_usable: float
    wheel_2_usable: float
    wheel_3_usable: float
    wheel_4_usable: float
    torque_usable: float
    acceleration_usable: float
    rates_usable: float
    slope_usable: float
    pressure_usable: float
    rate_limit: float  # articulation rate the machine is permitted at present [rad/s]


class State(NamedTuple):
    """What the estimators carry from cycle to cycle; `INITIAL` before the first."""

    cycles: float  # since the start
    payload: float
    speed: float
    articulation_rate: float
    articulation_acceleration: float
    roll_rate: float
    roll_acceleration: float
    pitch_rate: float
    pitch_acceleration: float
    yaw_rate: float
    yaw_acceleration: float
    wheel_speed_1: float
    wheel_speed_2: float
    wheel_speed_3: float
    wheel_speed_4: float
    wheel_acceleration_1: float
    wheel_acceleration_2: float
    wheel_acceleration_3: float
    wheel_acceleration_4: float
    normal_1: float
    normal_2: float
    normal_3: float
    normal_4: float
    force_1: float
    force_2: float
    force_3: float
    force_4: float
    deflection_1: float
    deflection_2: float
    deflection_3: float
    deflection_4: float
    drift: float
    axle_speed: float
    axle_acceleration: float
    roll_tilt: float
    pitch_tilt: float
    roll_bias: float
    pitch_bias: float


INITIAL = State(*([0.0] * len(State._fields)))


class Estimates(NamedTuple):
    """What the ECU tells about the machine, SI, ISO 8855."""

    normal_1: float
    normal_2: float
    normal_3: float
    normal_4: float
    longitudinal_1: float
    longitudinal_2: float
    longitudinal_3: float
    longitudinal_4: float
    lateral_1: float
    lateral_2: float
    lateral_3: float
    lateral_4: float
    slip_1: float
    slip_2: float
    slip_3: float
    slip_4: float
    tyre_model_1: float  # longitudinal force of the tyre model at the transient slip [N]
    tyre_model_2: float
    tyre_model_3: float
    tyre_model_4: float
    load_transfer_ratio: float
    predicted_load_transfer_ratio: float
    lift_off_margin: float
    lift_off_wheel: float
    predicted_margin: float
    time_to_lift_off: float
    lifting_wheel: float
    yaw_moment: float
    joint_torque: float
    yaw_rate: float
    speed: float
    specific_force_x: float  # at the machine's centre of gravity
    specific_force_y: float
    specific_force_z: float
    payload: float
    permitted_rate: float
    permitted_speed: float


class Motion(NamedTuple):
    """Inputs after filtering: derivatives, and which yaw rate to use."""

    rate: Vector
    change: Vector
    articulation_acceleration: float
    wheel_acceleration_1: float
    wheel_acceleration_2: float
    wheel_acceleration_3: float
    wheel_acceleration_4: float


class Accelerations(NamedTuple):
    """Specific force at the centres of gravity of front unit, rear unit and rear axle [m/s2]."""

    front: Vector
    rear: Vector
    axle: Vector


@compiled
def derivative(previous: float, now: float, filtered: float, dt: float, time: float) -> float:
    """Rate of change of a sampled signal, through a first-order filter of time constant `time` [s]."""
    return filtered + ((now - previous) / dt - filtered) * dt / (time + dt)


@compiled
def motion(i: Inputs, s: State, p: Parameters) -> Motion:
    """Angular and wheel accelerations from the sampled rates; without a gyro, yaw from the wheels."""
    if s.cycles == 0.0:
        rest = Vector(0.0, 0.0, 0.0)
        return Motion(Vector(i.roll_rate, i.pitch_rate, i.yaw_rate), rest, 0.0, 0.0, 0.0, 0.0, 0.0)
    dt, quick, wheel = i.dt, p.sensors.rate_time, p.sensors.wheel_time
    angular = derivative(s.articulation_rate, i.articulation_rate, s.articulation_acceleration, dt, quick)
    w1 = derivative(s.wheel_speed_1, i.wheel_speed_1, s.wheel_acceleration_1, dt, wheel)
    w2 = derivative(s.wheel_speed_2, i.wheel_speed_2, s.wheel_acceleration_2, dt, wheel)
    w3 = derivative(s.wheel_speed_3, i.wheel_speed_3, s.wheel_acceleration_3, dt, wheel)
    w4 = derivative(s.wheel_speed_4, i.wheel_speed_4, s.wheel_acceleration_4, dt, wheel)
    if i.rates_usable == 0.0:
        yaw = yaw_rate(s.speed, i.articulation_angle, i.articulation_rate, p.geometry)
        change = yaw_acceleration(
            s.speed, 0.0, i.articulation_angle, i.articulation_rate, angular, p.geometry
        )
        return Motion(Vector(0.0, 0.0, yaw), Vector(0.0, 0.0, change), angular, w1, w2, w3, w4)
    roll = derivative(s.roll_rate, i.roll_rate, s.roll_acceleration, dt, quick)
    pitch = derivative(s.pitch_rate, i.pitch_rate, s.pitch_acceleration, dt, quick)
    yaw = derivative(s.yaw_rate, i.yaw_rate, s.yaw_acceleration, dt, quick)
    rate = Vector(i.roll_rate, i.pitch_rate, i.yaw_rate)
    return Motion(rate, Vector(roll, pitch, yaw), angular, w1, w2, w3, w4)


@compiled
def measured_accelerations(i: Inputs, m: Motion, front: Body, p: Parameters) -> Accelerations:
    """Specific forces by transport from the inertial sensor through the joint."""
    sensed = Vector(i.specific_force_x, i.specific_force_y, i.specific_force_z)
    sx, sy, sz = p.sensors.imu_x, p.sensors.imu_y, p.sensors.imu_z
    joint = transported(sensed, m.rate, m.change, -sx, -sy, -sz)
    rear = transported(sensed, m.rate, m.change, p.rear.x - sx, -sy, p.rear.z - sz)
    axle = transported(sensed, m.rate, m.change, -p.geometry.rear_length - sx, -sy, p.axle.height - sz)
    c, s = math.cos(i.articulation_angle), math.sin(i.articulation_angle)
    dd = i.articulation_rate
    rate = Vector(m.rate.x, m.rate.y, m.rate.z + dd)
    change = Vector(
        m.change.x + m.rate.y * dd, m.change.y - m.rate.x * dd, m.change.z + m.articulation_acceleration
    )
    return Accelerations(transported(joint, rate, change, front.x * c, front.x * s, front.z), rear, axle)


@compiled
def kinematic_accelerations(i: Inputs, s: State, m: Motion, front: Body, p: Parameters) -> Accelerations:
    """Specific forces from wheel speed, articulation and slope, where the inertial sensor fails."""
    rest = gravity_reaction(i.pitch, i.roll, GRAVITY)
    u, du, g = s.axle_speed, s.axle_acceleration, p.geometry
    d, dd, ddd = i.articulation_angle, i.articulation_rate, m.articulation_acceleration
    rate = yaw_rate(u, d, dd, g)
    change = yaw_acceleration(u, du, d, dd, ddd, g)
    jx, jy = joint_acceleration(u, du, rate, change, g)
    fx, fy = planar_acceleration(
        jx, jy, front.x * math.cos(d), front.x * math.sin(d), rate + dd, change + ddd
    )
    rx, ry = planar_acceleration(jx, jy, p.rear.x, 0.0, rate, change)
    ax, ay = planar_acceleration(jx, jy, -g.rear_length, 0.0, rate, change)
    return Accelerations(
        Vector(fx + rest.x, fy + rest.y, rest.z),
        Vector(rx + rest.x, ry + rest.y, rest.z),
        Vector(ax + rest.x, ay + rest.y, rest.z),
    )


@compiled
def radius(normal: float, stiffening: float, wheel: Wheel) -> float:
    """Effective radius [m] under a normal force [N]."""
    loaded = wheel.unloaded_radius - tyre.deflection(normal, stiffening, wheel)
    return tyre.effective_radius(loaded, wheel.unloaded_radius)


@compiled
def spin_balance(torque: float, acceleration: float, normal: float, stiffening: float, w: Wheel) -> float:
    """Longitudinal force [N] that torque, spin and rolling resistance of a wheel require.

    The lever is the effective radius: at it a rolling tyre does no work without slip.
    """
    force = (torque - w.spin_inertia * acceleration) / radius(normal, stiffening, w)
    return force - w.rolling_resistance * max(normal, 0.0)


@compiled
def expected_slip(force: float, normal: float, wheel: Wheel) -> float:
    """Slip [-] that a longitudinal force needs in the linear range, at most 0.1."""
    slip = force / (wheel.slip_stiffness * max(normal, 0.1 * wheel.nominal_load))
    return min(max(slip, -0.1), 0.1)


@compiled
def fused_speed(i: Inputs, s: State, m: Motion, axle: Vector, r: Vector, p: Parameters) -> float:
    """Speed of the rear axle [m/s]: carried by acceleration, corrected by the wheels.

    r: effective radii of front left, front right and of both rear wheels [m].
    """
    g, w = p.geometry, p.wheel
    d, dd, yaw = i.articulation_angle, i.articulation_rate, m.rate.z
    v1 = speed.front_wheel_reading(
        i.wheel_speed_1 * r.x, expected_slip(s.force_1, s.normal_1, w), 1.0, d, yaw, dd, g
    )
    v2 = speed.front_wheel_reading(
        i.wheel_speed_2 * r.y, expected_slip(s.force_2, s.normal_2, w), -1.0, d, yaw, dd, g
    )
    v3 = speed.rear_wheel_reading(i.wheel_speed_3 * r.z, expected_slip(s.force_3, s.normal_3, w), 1.0, yaw, g)
    v4 = speed.rear_wheel_reading(
        i.wheel_speed_4 * r.z, expected_slip(s.force_4, s.normal_4, w), -1.0, yaw, g
    )
    count = i.wheel_1_usable + i.wheel_2_usable + i.wheel_3_usable + i.wheel_4_usable
    if count == 0.0:
        return s.speed
    total = i.wheel_1_usable * v1 + i.wheel_2_usable * v2 + i.wheel_3_usable * v3 + i.wheel_4_usable * v4
    if s.cycles == 0.0:
        return total / count
    trusted = i.acceleration_usable * i.slope_usable
    predicted = s.speed
    if trusted != 0.0:
        rest = gravity_reaction(i.pitch, i.roll, GRAVITY)
        predicted += (axle.x - rest.x) * i.dt
    scatter = p.sensors.speed_scatter + p.sensors.speed_scatter_slope * abs(predicted)
    gain = p.sensors.speed_gain * i.dt if trusted != 0.0 else 0.5
    e1, e2, e3, e4 = v1 - predicted, v2 - predicted, v3 - predicted, v4 - predicted
    # wheels that roll and all agree are believed in the end, or a wrong start would never be mended
    mean = total / count
    spread = max(abs(v1 - mean), abs(v2 - mean), abs(v3 - mean), abs(v4 - mean))
    least = speed.CONSENSUS if count == 4.0 and spread < scatter and abs(mean) > speed.ROLLING else 0.0
    correction = i.wheel_1_usable * e1 * max(speed.influence(e1, scatter), least)
    correction += i.wheel_2_usable * e2 * max(speed.influence(e2, scatter), least)
    correction += i.wheel_3_usable * e3 * max(speed.influence(e3, scatter), least)
    correction += i.wheel_4_usable * e4 * max(speed.influence(e4, scatter), least)
    if trusted == 0.0:  # nothing else carries the speed: the plain mean
        correction = total - count * predicted
    return predicted + gain * correction / count


@compiled
def centre_force(a: Accelerations, front: Body, rear: Body, axle_mass: float) -> Vector:
    """Specific force at the whole machine's centre of gravity: the mass-weighted mean [m/s2]."""
    mass = front.mass + rear.mass + axle_mass
    return Vector(
        (front.mass * a.front.x + rear.mass * a.rear.x + axle_mass * a.axle.x) / mass,
        (front.mass * a.front.y + rear.mass * a.rear.y + axle_mass * a.axle.y) / mass,
        (front.mass * a.front.z + rear.mass * a.rear.z + axle_mass * a.axle.z) / mass,
    )


@compiled
def next_state(
    i: Inputs, s: State, m: Motion, load: float, fused: float, axle_speed: float, axle_acceleration: float,
    n: NormalForces, f: WheelForces, u: WheelForces, drift: float, tilt: Tilt, bias: Tilt,
) -> State:  # fmt: skip
    """The state for the next cycle."""
    return State(
        s.cycles + 1.0, load, fused, i.articulation_rate, m.articulation_acceleration,
        i.roll_rate, m.change.x, i.pitch_rate, m.change.y, i.yaw_rate, m.change.z,
        i.wheel_speed_1, i.wheel_speed_2, i.wheel_speed_3, i.wheel_speed_4,
        m.wheel_acceleration_1, m.wheel_acceleration_2, m.wheel_acceleration_3, m.wheel_acceleration_4,
        n.front_left, n.front_right, n.rear_left, n.rear_right,
        f.x1, f.x2, f.x3, f.x4, u.x1, u.x2, u.x3, u.x4, drift, axle_speed, axle_acceleration,
        tilt.roll, tilt.pitch, bias.roll, bias.pitch,
    )  # fmt: skip


@compiled
def wheel_slips(i: Inputs, yaw: float, v: float, drift: float, n: NormalForces, p: Parameters) -> WheelForces:
    """Longitudinal slip (x1..x4) and slip angle [rad] (y1..y4) of each wheel.

    v: speed of the rear axle along its frame [m/s]; drift: its speed to the left [m/s].
    """
    g, w = p.geometry, p.wheel
    d, dd = i.articulation_angle, i.articulation_rate
    c, s = math.cos(d), math.sin(d)
    joint_y = drift + g.rear_length * yaw
    axle_x = v * c + joint_y * s
    axle_y = -v * s + joint_y * c + g.front_length * (yaw + dd)
    turn_front, turn_rear = g.front_track / 2.0 * (yaw + dd), g.rear_track / 2.0 * yaw
    r1 = radius(n.front_left, w.front_stiffening, w)
    r2 = radius(n.front_right, w.front_stiffening, w)
    r3 = radius(n.rear_left, w.rear_stiffening, w)
    r4 = radius(n.rear_right, w.rear_stiffening, w)
    low = w.low_speed
    return WheelForces(
        tyre.slip(i.wheel_speed_1, r1, axle_x - turn_front, low),
        tyre.slip(i.wheel_speed_2, r2, axle_x + turn_front, low),
        tyre.slip(i.wheel_speed_3, r3, v - turn_rear, low),
        tyre.slip(i.wheel_speed_4, r4, v + turn_rear, low),
        tyre.slip_angle(axle_x - turn_front, axle_y, low),
        tyre.slip_angle(axle_x + turn_front, axle_y, low),
        tyre.slip_angle(v - turn_rear, drift, low),
        tyre.slip_angle(v + turn_rear, drift, low),
    )


@compiled
def transient_force(
    u: float, slip: float, v: float, normal: float, pressure: float, dt: float, p: Parameters
) -> tuple[float, float]:
    """Deflection of the contact point [m] and the tyre model's longitudinal force [N] (33)-(35)."""
    sigma = p.wheel.longitudinal_relaxation
    new = tyre.contact_point(u, slip * max(abs(v), p.wheel.low_speed), v, sigma, dt)
    return new, tyre.magic_formula(new / sigma, normal, pressure, p.magic_formula)


@compiled
def shared(total: float, left: float, right: float) -> tuple[float, float]:
    """A lateral axle force [N] divided over its wheels in proportion to their loads."""
    a, b = max(left, 0.0), max(right, 0.0)
    if a + b <= 0.0:
        return total / 2.0, total / 2.0
    return total * a / (a + b), total * b / (a + b)


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
def corrected(i: Inputs, s: State, p: Parameters) -> tuple[Estimates, State]:
    """One cycle of the corrected estimators."""
    g, w = p.geometry, p.wheel
    m = motion(i, s, p)
    front = front_unit(i.lift_arm_angle, i.tilt_angle, s.payload, p.front, p.arm, p.bucket)
    a = kinematic_accelerations(i, s, m, front, p)
    if i.acceleration_usable != 0.0:
        a = measured_accelerations(i, m, front, p)

    # payload
    d = i.articulation_angle
    c, sn = math.cos(d), math.sin(d)
    load = s.payload
    if i.pressure_usable != 0.0:
        fresh = payload(
            i.lift_pressure, i.lift_arm_angle, i.tilt_angle, a.front.x * c + a.front.y * sn, a.front.z,
            p.arm, p.bucket, p.cylinders,
        )  # fmt: skip
        share = i.dt / (p.cylinders.settling_time + i.dt) if s.cycles != 0.0 else 1.0
        load += (fresh - load) * share
        front = front_unit(i.lift_arm_angle, i.tilt_angle, load, p.front, p.arm, p.bucket)

    # speed
    r1 = radius(s.normal_1, w.front_stiffening, w)
    r2 = radius(s.normal_2, w.front_stiffening, w)
    r3 = radius((s.normal_3 + s.normal_4) / 2.0, w.rear_stiffening, w)
    v = fused_speed(i, s, m, a.axle, Vector(r1, r2, r3), p)
    axle_speed = (i.wheel_speed_3 + i.wheel_speed_4) / 2.0 * r3
    axle_acceleration = (m.wheel_acceleration_3 + m.wheel_acceleration_4) / 2.0 * r3
    travel = min(max(v / 0.5, -1.0), 1.0)

    # longitudinal forces: from the wheels' own balance, else the machine's, shared equally
    side = front.mass * a.front.y + p.rear.mass * a.rear.y + p.axle.mass * a.axle.y
    push = front.mass * a.front.x + p.rear.mass * a.rear.x + p.axle.mass * a.axle.x
    equal = push / (2.0 + 2.0 * c)
    x1, x2, x3, x4 = equal, equal, equal, equal
    if i.torque_usable != 0.0:
        x1 = spin_balance(i.wheel_torque_1, m.wheel_acceleration_1, s.normal_1, w.front_stiffening, w)
        x2 = spin_balance(i.wheel_torque_2, m.wheel_acceleration_2, s.normal_2, w.front_stiffening, w)
        x3 = spin_balance(i.wheel_torque_3, m.wheel_acceleration_3, s.normal_3, w.rear_stiffening, w)
        x4 = spin_balance(i.wheel_torque_4, m.wheel_acceleration_4, s.normal_4, w.rear_stiffening, w)

    # lateral axle forces and joint torque from the moments about the joint
    front_yaw = m.change.z + m.articulation_acceleration
    front_moment = front.mass * front.x * (c * a.front.y - sn * a.front.x) + front.yaw_inertia * front_yaw
    moment = front_moment + p.rear.mass * p.rear.x * a.rear.y - p.axle.mass * g.rear_length * a.axle.y
    moment += (p.rear.yaw_inertia + p.axle.roll_inertia) * m.change.z
    only_x = WheelForces(x1, x2, x3, x4, 0.0, 0.0, 0.0, 0.0)
    lateral = turning.lateral_forces(side, moment, front_moment, only_x, w.pneumatic_trail * travel, d, g)

    # support point: every lump's inertia force at its own centre, and what spins
    xf, yf = front.x * c, front.x * sn
    carried = front.mass * a.front.z + p.rear.mass * a.rear.z
    pivot_side = lateral.rear - p.axle.mass * a.axle.y
    about_y = xf * front.mass * a.front.z + p.rear.x * p.rear.mass * a.rear.z
    about_y -= front.z * front.mass * a.front.x + p.rear.z * p.rear.mass * a.rear.x
    about_y -= p.axle.height * p.axle.mass * a.axle.x
    about_x = yf * front.mass * a.front.z - front.z * front.mass * a.front.y
    about_x += g.pivot_height * pivot_side - p.rear.z * p.rear.mass * a.rear.y
    # the front unit's inertia turned into rear axes
    along = c * m.change.x + sn * m.change.y
    across = c * m.change.y - sn * m.change.x
    front_x, front_y = front.roll_inertia * along, front.pitch_inertia * across
    about_x += p.rear.roll_inertia * m.change.x + front_x * c - front_y * sn
    about_y -= p.rear.pitch_inertia * m.change.y + front_x * sn + front_y * c
    spin_front = w.spin_inertia * (m.wheel_acceleration_1 + m.wheel_acceleration_2)
    spin_rear = w.spin_inertia * (m.wheel_acceleration_3 + m.wheel_acceleration_4)
    gyro_front = w.spin_inertia * (i.wheel_speed_1 + i.wheel_speed_2) * (m.rate.z + i.articulation_rate)
    gyro_rear = w.spin_inertia * (i.wheel_speed_3 + i.wheel_speed_4) * m.rate.z
    about_y -= spin_front * c + spin_rear - gyro_front * sn
    about_x -= gyro_front * c + spin_front * sn
    support = Support(carried, about_y / carried, about_x / carried)
    axle_load = p.axle.mass * a.axle.z
    axle_moment = g.pivot_height * pivot_side + p.axle.height * p.axle.mass * a.axle.y + gyro_rear
    free = normal_force.normal_forces(support, d, axle_load, axle_moment, g)
    stopped = normal_force.on_axle_stop(free, d, axle_moment, axle_load, g)
    n = NormalForces(
        free.front_left if free.front_left < 0.0 else stopped.front_left,
        free.front_right if free.front_right < 0.0 else stopped.front_right,
        stopped.pivot, stopped.rear_left, stopped.rear_right,
    )  # fmt: skip
    n, followed = follow_tilt(i, s, m, n, p)

    # roll-over: now and ahead
    machine = rollover.laden(front, p)
    now = rollover.margin(n, machine.standing)
    rest = Vector(a.rear.x, a.rear.y, a.rear.z)
    if i.slope_usable != 0.0:
        rest = gravity_reaction(i.pitch, i.roll, GRAVITY)
    acceleration = (a.axle.x - rest.x) if i.acceleration_usable != 0.0 else axle_acceleration
    front_load, rear_load = n.front_left + n.front_right, n.rear_left + n.rear_right
    steering = Steering(d, i.articulation_rate, m.articulation_acceleration, v, acceleration, rest.x, rest.y)
    slide = slid(s.drift, m.rate.z, steering, front_load, rear_load, i.dt, front, machine.rear_unit, w, g)
    over = rollover.support_of(n, d, g)
    demand = i.articulation_rate_demand if i.demand_usable != 0.0 else i.articulation_rate
    course = Course(
        d, i.articulation_rate, demand, v, acceleration, rest.x, rest.y, rest.z, slide.drift, m.rate.z,
        front_load, rear_load, over.y, contact.support_rate(n, followed.rate, d, i.articulation_rate, w, g),
    )  # fmt: skip
    permitted_rate = rollover.permitted_rate(course, machine)
    asked = rollover.demanding(course, min(max(demand, -i.rate_limit), i.rate_limit))
    outlook = rollover.look_ahead(asked, p.prediction.demand_hold, machine)
    turned = d + i.articulation_rate * p.prediction.limit_hold
    turned = min(max(turned, -g.articulation_stop), g.articulation_stop)
    permitted_speed = rollover.permitted_speed(turned, rest, 1.0 if v >= 0.0 else -1.0, machine)

    # tyres
    y1, y2 = shared(lateral.front, n.front_left, n.front_right)
    y3, y4 = shared(lateral.rear, n.rear_left, n.rear_right)
    slips = wheel_slips(i, m.rate.z, v, slide.drift - g.rear_length * m.rate.z, n, p)
    u1, t1 = transient_force(s.deflection_1, slips.x1, v, n.front_left, w.front_pressure, i.dt, p)
    u2, t2 = transient_force(s.deflection_2, slips.x2, v, n.front_right, w.front_pressure, i.dt, p)
    u3, t3 = transient_force(s.deflection_3, slips.x3, v, n.rear_left, w.rear_pressure, i.dt, p)
    u4, t4 = transient_force(s.deflection_4, slips.x4, v, n.rear_right, w.rear_pressure, i.dt, p)

    # turning
    whole = machine_centre(d, front, machine.rear_unit)
    forces = WheelForces(x1, x2, x3, x4, y1, y2, y3, y4)
    turn = turning.yaw_moment(forces, whole.x, whole.y, d, g)
    turn -= w.pneumatic_trail * travel * (lateral.front + lateral.rear)

    f = centre_force(a, front, p.rear, p.axle.mass)
    estimates = Estimates(
        n.front_left, n.front_right, n.rear_left, n.rear_right,
        x1, x2, x3, x4, y1, y2, y3, y4, slips.x1, slips.x2, slips.x3, slips.x4, t1, t2, t3, t4,
        rollover.load_transfer_ratio(n), outlook.load_transfer_ratio, now.ratio, now.wheel,
        outlook.margin, outlook.time_to_lift_off, outlook.wheel, turn, lateral.joint_torque,
        yaw_rate(v, d, i.articulation_rate, g), v, f.x, f.y, f.z, load, permitted_rate, permitted_speed,
    )  # fmt: skip
    deflections = WheelForces(u1, u2, u3, u4, 0.0, 0.0, 0.0, 0.0)
    state = next_state(
        i, s, m, load, v, axle_speed, axle_acceleration, n, forces, deflections, slide.drift,
        followed.tilt, followed.bias,
    )  # fmt: skip
    return estimates, state


@compiled
def printed(i: Inputs, s: State, p: Parameters) -> tuple[Estimates, State]:
    """One cycle of the estimators as the thesis has them, for comparison.

    Centre of gravity by (36)-(42) (its sign clash and its y balance repaired, E-09, E-10), acceleration
    as in 2.5, normal forces by the printed balances (71)-(87), tyre forces from slip, turning moment by
    (93), (94). There is no prediction: lift-off is reported when the estimate has got there.
    """
    g, w = p.geometry, p.wheel
    m = motion(i, s, p)
    d = i.articulation_angle
    load = s.payload
    if i.pressure_usable != 0.0:
        fresh = payload(
            i.lift_pressure, i.lift_arm_angle, i.tilt_angle, 0.0, GRAVITY, p.arm, p.bucket, p.cylinders
        )
        share = i.dt / (p.cylinders.settling_time + i.dt) if s.cycles != 0.0 else 1.0
        load += (fresh - load) * share
    front = front_unit_printed(i.lift_arm_angle, load, p.front, p.arm, p.bucket)
    centre = machine_centre(d, front, p.rear)

    radius_nominal = radius(w.nominal_load, 1.0, w)
    v = (i.wheel_speed_1 + i.wheel_speed_2 + i.wheel_speed_3 + i.wheel_speed_4) / 4.0 * radius_nominal
    rate = (
        m.wheel_acceleration_1 + m.wheel_acceleration_2 + m.wheel_acceleration_3 + m.wheel_acceleration_4
    ) / 4.0
    dv = rate * radius_nominal
    ax, ay = printed_acceleration(dv, -d)  # y to the right, as delta in the thesis
    arms = normal_force.printed_arms(centre, d, g)
    n = normal_force.printed_normal_forces(
        centre.mass, centre.z, arms, ax, ay, -i.pitch, -i.roll, GRAVITY,
        p.axle.mass, p.axle.height, g.rear_track / 2.0, g.pivot_height,
    )  # fmt: skip

    standing_arms = normal_force.printed_arms(centre, 0.0, g)
    straight = normal_force.printed_normal_forces(
        centre.mass, centre.z, standing_arms, 0.0, 0.0, 0.0, 0.0, GRAVITY,
        p.axle.mass, p.axle.height, g.rear_track / 2.0, g.pivot_height,
    )  # fmt: skip
    now = rollover.margin(n, straight)
    lift_off = 0.0 if now.ratio <= 0.0 else NEVER

    yaw = yaw_rate(v, d, 0.0, g)
    slips = wheel_slips(i, yaw, v, 0.0, n, p)
    u1, x1 = transient_force(s.deflection_1, slips.x1, v, n.front_left, w.front_pressure, i.dt, p)
    u2, x2 = transient_force(s.deflection_2, slips.x2, v, n.front_right, w.front_pressure, i.dt, p)
    u3, x3 = transient_force(s.deflection_3, slips.x3, v, n.rear_left, w.rear_pressure, i.dt, p)
    u4, x4 = transient_force(s.deflection_4, slips.x4, v, n.rear_right, w.rear_pressure, i.dt, p)
    y1 = tyre.lateral_force(slips.y1, n.front_left, w)
    y2 = tyre.lateral_force(slips.y2, n.front_right, w)
    y3 = tyre.lateral_force(slips.y3, n.rear_left, w)
    y4 = tyre.lateral_force(slips.y4, n.rear_right, w)
    forces = WheelForces(x1, x2, x3, x4, y1, y2, y3, y4)
    turn = turning.yaw_moment_printed(forces, centre.x, centre.y, d, g)

    transfer = rollover.load_transfer_ratio(n)
    estimates = Estimates(
        n.front_left, n.front_right, n.rear_left, n.rear_right,
        x1, x2, x3, x4, y1, y2, y3, y4, slips.x1, slips.x2, slips.x3, slips.x4, x1, x2, x3, x4,
        transfer, transfer, now.ratio, now.wheel, now.ratio, lift_off, now.wheel, turn, turn, yaw, v,
        ax - GRAVITY * math.sin(i.pitch), -ay + GRAVITY * math.sin(i.roll), GRAVITY * math.cos(i.pitch) * math.cos(i.roll),
        load, p.prediction.largest_rate, p.prediction.largest_speed,
    )  # fmt: skip
    deflections = WheelForces(u1, u2, u3, u4, 0.0, 0.0, 0.0, 0.0)
    none = Tilt(0.0, 0.0)
    return estimates, next_state(i, s, m, load, v, v, dv, n, forces, deflections, 0.0, none, none)
