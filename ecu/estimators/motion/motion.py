"""How the machine moves in this cycle: rates, accelerations of its parts, speed. ISO 8855, rear frame axes."""

import math
from typing import NamedTuple

from ecu.estimators.compiled import compiled
from ecu.estimators.inclination import Lean, Slope, followed_speed, lean_at_start, leaned
from ecu.estimators.motion import speed
from ecu.estimators.motion.acceleration import (
    gravity_reaction,
    joint_acceleration,
    planar_acceleration,
    transported,
    yaw_acceleration,
    yaw_rate,
)
from ecu.estimators.motion.speed import Fused
from ecu.estimators.parameters import GRAVITY, Body, Parameters
from ecu.estimators.quantities import Vector
from ecu.estimators.signals import Inputs
from ecu.estimators.state import State
from ecu.estimators.tyres.wheels import expected_slip


class Motion(NamedTuple):
    """Inputs after filtering: angular rates, and the derivatives of sampled signals."""

    rate: Vector  # angular velocity of the rear frame [rad/s]; yaw from the wheels where the gyro fails
    change: Vector  # angular acceleration of the rear frame [rad/s2]
    articulation_acceleration: float  # [rad/s2]
    wheel_acceleration_1: float  # [rad/s2]
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
def kinematic_accelerations(
    i: Inputs, s: State, m: Motion, slope: Slope, front: Body, p: Parameters
) -> Accelerations:
    """Specific forces from wheel speed, articulation and slope, where the inertial sensor fails."""
    rest = gravity_reaction(slope.pitch, slope.roll, GRAVITY)
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
def fused_speed(
    i: Inputs, s: State, m: Motion, axle: Vector, slope: Slope, r: Vector, p: Parameters
) -> Fused:
    """Speed of the rear axle: carried by acceleration, corrected by the wheels.

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
    grip = w.lateral_peak * GRAVITY * i.dt
    count = i.wheel_1_usable + i.wheel_2_usable + i.wheel_3_usable + i.wheel_4_usable
    if count == 0.0:
        return Fused(s.speed, min(s.speed_doubt + grip, speed.DOUBT_MOST))
    total = i.wheel_1_usable * v1 + i.wheel_2_usable * v2 + i.wheel_3_usable * v3 + i.wheel_4_usable * v4
    if s.cycles == 0.0:
        return Fused(total / count, 0.0)
    trusted = i.acceleration_usable * i.slope_usable
    if s.cycles * i.dt < p.sensors.slope_levelling:
        # Which acceleration the inclination sensor took for a slope before the start is not known.
        trusted = 0.0
    predicted = s.speed
    if trusted != 0.0:
        rest = gravity_reaction(slope.pitch, slope.roll, GRAVITY)
        predicted += (axle.x - rest.x) * i.dt
    scatter = p.sensors.speed_scatter + p.sensors.speed_scatter_slope * abs(predicted)
    gain = p.sensors.speed_gain * i.dt if trusted != 0.0 else 0.5
    e1, e2, e3, e4 = v1 - predicted, v2 - predicted, v3 - predicted, v4 - predicted
    # four wheels that roll and agree keep a least influence, so that a wrong start value is corrected in the end
    mean = total / count
    spread = max(abs(v1 - mean), abs(v2 - mean), abs(v3 - mean), abs(v4 - mean))
    least = speed.CONSENSUS if count == 4.0 and spread < scatter and abs(mean) > speed.ROLLING else 0.0
    if trusted == 0.0:  # nothing else carries the speed: the plain mean
        change = gain * (total - count * predicted) / count
        return Fused(predicted + change, speed.doubt_of_wheels(s.speed_doubt, change, grip, i.dt))
    i1, i2 = speed.influence(e1, scatter), speed.influence(e2, scatter)
    i3, i4 = speed.influence(e3, scatter), speed.influence(e4, scatter)
    correction = i.wheel_1_usable * e1 * max(i1, least)
    correction += i.wheel_2_usable * e2 * max(i2, least)
    correction += i.wheel_3_usable * e3 * max(i3, least)
    correction += i.wheel_4_usable * e4 * max(i4, least)
    # A slope that is a little wrong carries the speed away from wheels that stand, whose influence is then nothing.
    carried = min(max(mean - predicted, -1.0), 1.0) * speed.DRIFT * i.dt
    weight = i.wheel_1_usable * i1 + i.wheel_2_usable * i2 + i.wheel_3_usable * i3 + i.wheel_4_usable * i4
    # what the least influence moves is no evidence: wheels that all slide alike agree too
    agreed = i.wheel_1_usable * e1 * max(least - i1, 0.0) + i.wheel_2_usable * e2 * max(least - i2, 0.0)
    agreed += i.wheel_3_usable * e3 * max(least - i3, 0.0) + i.wheel_4_usable * e4 * max(least - i4, 0.0)
    unproven = carried * (1.0 - weight / count) + gain * agreed / count
    doubt = speed.doubt_carried(s.speed_doubt, weight / count, unproven, gain, i.dt)
    return Fused(predicted + gain * correction / count + carried, doubt)


@compiled
def lean_before(s: State, m: Motion, axle_speed: float) -> Slope:
    """What accelerations add to the inclination sensor's reading of this cycle; axle_speed: by the wheels [m/s]."""
    if s.cycles == 0.0:
        return lean_at_start(m.rate.z * axle_speed)
    return Slope(s.pitch_lean, s.roll_lean)


@compiled
def lean_after(
    i: Inputs, s: State, m: Motion, lean: Slope, slope: Slope, v: float, axle_speed: float, p: Parameters
) -> Lean:
    """The same for the next cycle; v, axle_speed: of the rear axle, fused and by the wheels [m/s]."""
    ahead_of_axle = p.sensors.imu_x + p.geometry.rear_length
    before, speed_now = v, v
    if s.cycles != 0.0:
        before = s.lean_speed
        speed_now = followed_speed(before, v - s.speed, axle_speed, i.dt)
    ahead = (speed_now - before) / i.dt - m.rate.z * m.rate.z * ahead_of_axle
    aside = v * m.rate.z + m.change.z * ahead_of_axle
    after = leaned(lean, slope, ahead, aside, i.dt, p.sensors.slope_levelling)
    return Lean(after.pitch, after.roll, speed_now)


@compiled
def centre_force(a: Accelerations, front: Body, rear: Body, axle_mass: float) -> Vector:
    """Specific force at the whole machine's centre of gravity: the mass-weighted mean [m/s2]."""
    mass = front.mass + rear.mass + axle_mass
    return Vector(
        (front.mass * a.front.x + rear.mass * a.rear.x + axle_mass * a.axle.x) / mass,
        (front.mass * a.front.y + rear.mass * a.rear.y + axle_mass * a.axle.y) / mass,
        (front.mass * a.front.z + rear.mass * a.rear.z + axle_mass * a.axle.z) / mass,
    )
