"""Balance of forces: lateral axle forces, joint torque and normal forces that the measured motion requires.

Every lump (front unit with payload, rear frame, rear axle) is pressed on the ground by its own specific
force at its own centre of gravity, and what turns or spins adds its moment (docs/explanation/estimators.md).
"""

import math
from typing import NamedTuple

from ecu.estimators.compiled import compiled
from ecu.estimators.joint import Joint
from ecu.estimators.loads import normal_force
from ecu.estimators.loads.arm_forces import ArmForces
from ecu.estimators.loads.leaning import Leaning
from ecu.estimators.loads.normal_force import Support
from ecu.estimators.loads.payload import Push
from ecu.estimators.motion.motion import Accelerations, Motion
from ecu.estimators.parameters import Body, Parameters, Wheel
from ecu.estimators.quantities import NormalForces, WheelForces
from ecu.estimators.signals import Inputs
from ecu.estimators.stability import turning
from ecu.estimators.stability.turning import Lateral
from ecu.estimators.state import State
from ecu.estimators.tyres.wheels import spin_balance


class Balance(NamedTuple):
    """Forces of the tyres by the balance: lateral per axle, normal per wheel."""

    lateral: Lateral
    normal: NormalForces
    carried: float  # what the normal forces have to add up to: mass times vertical specific force [N]


STILL = 0.1
"""Below this speed a wheel may be held by its brake [rad/s]; the sensor's resolution is 0.003."""
MOVING = 0.3
"""Speed of the machine from which on a wheel that stands is held [m/s]: no drive stops it there."""


LEAST_SHARE = 0.1
"""Share of the nominal load with which a held wheel counts at least, so that there is always one to bear the rest."""


@compiled
def held(i: Inputs, wheel_speed: float, speed: float) -> float:
    """1 for a wheel that its brake holds, or may hold: what the brake bears is then not known from its pressure; else 0."""
    if abs(wheel_speed) >= STILL:
        return 0.0
    braked = i.demand_usable == 0.0 or i.brake_demand > 0.0
    return 1.0 if braked or abs(speed) > MOVING else 0.0


@compiled
def bears(held_wheel: float, normal: float, w: Wheel) -> float:
    """Weight of a held wheel [N] when forces are shared: its load of the cycle before; 0 of a wheel that turns."""
    return held_wheel * max(normal, LEAST_SHARE * w.nominal_load)


@compiled
def with_held(i: Inputs, s: State, push: float, x: WheelForces, w: Wheel) -> WheelForces:
    """The forces of held wheels from the machine's balance: what the others do not give of its push, shared by load.

    push: force along the rear frame that moves the machine [N]. A pile's force and the front axle's lateral force are those of
    the cycle before.
    """
    b1 = bears(held(i, i.wheel_speed_1, s.speed), s.normal_1, w)
    b2 = bears(held(i, i.wheel_speed_2, s.speed), s.normal_2, w)
    b3 = bears(held(i, i.wheel_speed_3, s.speed), s.normal_3, w)
    b4 = bears(held(i, i.wheel_speed_4, s.speed), s.normal_4, w)
    if b1 + b2 + b3 + b4 == 0.0:
        return x
    c = math.cos(i.articulation_angle)
    x1, x2 = (0.0 if b1 > 0.0 else x.x1), (0.0 if b2 > 0.0 else x.x2)
    x3, x4 = (0.0 if b3 > 0.0 else x.x3), (0.0 if b4 > 0.0 else x.x4)
    rest = push - s.push_x * s.digging * c + s.front_side * math.sin(i.articulation_angle)
    rest -= (x1 + x2) * c + x3 + x4
    per_load = rest / ((b1 + b2) * c + b3 + b4)
    return WheelForces(
        x1 + per_load * b1, x2 + per_load * b2, x3 + per_load * b3, x4 + per_load * b4, 0.0, 0.0, 0.0, 0.0
    )


@compiled
def longitudinal_forces(
    i: Inputs, s: State, m: Motion, a: Accelerations, lean: Leaning, front: Body, p: Parameters
) -> WheelForces:
    """Longitudinal forces from the wheels' own balance; held wheels from the machine's, and all of them without torques, shared equally. Lateral ones 0."""
    w = p.wheel
    push = front.mass * a.front.x + p.rear.mass * a.rear.x + p.axle.mass * a.axle.x - lean.along
    if i.torque_usable == 0.0:
        equal = push / (2.0 + 2.0 * math.cos(i.articulation_angle))
        return WheelForces(equal, equal, equal, equal, 0.0, 0.0, 0.0, 0.0)
    turning_wheels = WheelForces(
        spin_balance(i.wheel_torque_1, m.wheel_acceleration_1, s.normal_1, w.front_stiffening, w),
        spin_balance(i.wheel_torque_2, m.wheel_acceleration_2, s.normal_2, w.front_stiffening, w),
        spin_balance(i.wheel_torque_3, m.wheel_acceleration_3, s.normal_3, w.rear_stiffening, w),
        spin_balance(i.wheel_torque_4, m.wheel_acceleration_4, s.normal_4, w.rear_stiffening, w),
        0.0,
        0.0,
        0.0,
        0.0,
    )
    return with_held(i, s, push, turning_wheels, w)


@compiled
def lateral_balance(
    i: Inputs,
    m: Motion,
    a: Accelerations,
    front: Body,
    push: Push,
    arm: ArmForces,
    along: WheelForces,
    trail: float,
    lean: Leaning,
    joint: Joint,
    p: Parameters,
) -> Lateral:
    """Lateral axle forces and joint torque from the moments of both halves about the joint; lean: of the wheel loads, which the tyres need not give."""
    c, s = joint.cosine, joint.sine
    side = front.mass * a.front.y + p.rear.mass * a.rear.y + p.axle.mass * a.axle.y
    side -= push.x * s  # its line passes through the joint: no moment about it
    front_yaw = m.change.z + m.articulation_acceleration
    side += arm.x * s + arm.y * c - lean.across
    front_moment = front.mass * front.x * (c * a.front.y - s * a.front.x) + front.yaw_inertia * front_yaw
    front_moment += arm.yawing - lean.front_moment
    moment = front_moment - lean.rear_moment + p.rear.mass * p.rear.x * a.rear.y
    moment -= p.axle.mass * p.geometry.rear_length * a.axle.y
    moment += (p.rear.yaw_inertia + p.axle.roll_inertia) * m.change.z
    return turning.lateral_forces(side, moment, front_moment, along, trail, joint, p.geometry)


@compiled
def balance(
    i: Inputs,
    m: Motion,
    a: Accelerations,
    front: Body,
    push: Push,
    arm: ArmForces,
    along: WheelForces,
    trail: float,
    lean: Leaning,
    joint: Joint,
    p: Parameters,
) -> Balance:
    """Lateral and normal forces; trail: pneumatic trail with the sign of travel [m].

    lean: of the wheel loads.

    push: force on the bucket beside its weight, a fifth contact; arm: of arm and bucket that move on the front frame.

    Beyond the axle's stop the front wheels' forces are those that lifted them, the others those on the stop.
    """
    g, w = p.geometry, p.wheel
    c, s = joint.cosine, joint.sine
    lateral = lateral_balance(i, m, a, front, push, arm, along, trail, lean, joint, p)
    xf, yf = front.x * c, front.x * s
    carried = front.mass * a.front.z + p.rear.mass * a.rear.z - push.z + arm.z
    pivot_side = lateral.rear + lean.rear - p.axle.mass * a.axle.y
    about_y = xf * front.mass * a.front.z + p.rear.x * p.rear.mass * a.rear.z
    about_y -= front.z * front.mass * a.front.x + p.rear.z * p.rear.mass * a.rear.x
    about_y -= p.axle.height * p.axle.mass * a.axle.x
    about_x = yf * front.mass * a.front.z - front.z * front.mass * a.front.y
    about_x += g.pivot_height * pivot_side - p.rear.z * p.rear.mass * a.rear.y
    # a force on the bucket's edge, and a load that lies elsewhere in the bucket
    pitching = push.couple - push.ahead * push.z + push.height * push.x
    about_y += pitching * c
    about_x += pitching * s
    # arm and bucket that move on the front frame
    about_y += arm.pitching * c - arm.rolling * s
    about_x += arm.pitching * s + arm.rolling * c
    # the front unit's inertia turned into rear axes
    roll_change = c * m.change.x + s * m.change.y
    pitch_change = c * m.change.y - s * m.change.x
    front_x, front_y = front.roll_inertia * roll_change, front.pitch_inertia * pitch_change
    about_x += p.rear.roll_inertia * m.change.x + front_x * c - front_y * s
    about_y -= p.rear.pitch_inertia * m.change.y + front_x * s + front_y * c
    # the wheels: spin and gyroscopic moments
    spin_front = w.spin_inertia * (m.wheel_acceleration_1 + m.wheel_acceleration_2)
    spin_rear = w.spin_inertia * (m.wheel_acceleration_3 + m.wheel_acceleration_4)
    gyro_front = w.spin_inertia * (i.wheel_speed_1 + i.wheel_speed_2) * (m.rate.z + i.articulation_rate)
    gyro_rear = w.spin_inertia * (i.wheel_speed_3 + i.wheel_speed_4) * m.rate.z
    about_y -= spin_front * c + spin_rear - gyro_front * s
    about_x -= gyro_front * c + spin_front * s
    support = Support(carried, about_y / carried, about_x / carried)
    axle_load = p.axle.mass * a.axle.z
    # the rear axle stays with the road while the frame rolls above it
    axle_side = p.axle.mass * a.axle.y - lean.roll * axle_load
    pressing = pivot_side - lean.rear + lean.roll * axle_load
    axle_moment = g.pivot_height * pressing + p.axle.height * axle_side + gyro_rear
    free = normal_force.normal_forces(support, joint, axle_load, axle_moment, g)
    stopped = normal_force.on_axle_stop(free, joint, axle_moment, axle_load, g)
    normal = NormalForces(
        free.front_left if free.front_left < 0.0 else stopped.front_left,
        free.front_right if free.front_right < 0.0 else stopped.front_right,
        stopped.pivot,
        stopped.rear_left,
        stopped.rear_right,
    )
    return Balance(lateral, normal, carried + axle_load)
