"""The thesis' printed estimators with corrections that can be turned on one by one, over whole recordings.

ISO 8855 outside; the balances are solved in the thesis' frame (y right) with its unsigned distances (86), (87). All
corrections at zero: the print, (71)-(87) as solved (E-14, E-20), acceleration as in 2.5, (93) and (94).
"""

import math
from typing import Final, NamedTuple

from discrepancy.signals.recording import Array
from ecu.estimators.compiled import compiled
from ecu.estimators.loads.cog import front_unit, machine_centre, with_axle
from ecu.estimators.parameters import GRAVITY, Body, Parameters
from ecu.estimators.printed.centre import front_unit_printed
from ecu.estimators.printed.motion import printed_acceleration
from ecu.estimators.printed.normal_force import printed_arms
from ecu.estimators.printed.turning import yaw_moment_printed
from ecu.estimators.quantities import Centre, WheelForces
from ecu.estimators.stability.turning import joint_torque, yaw_moment

WHEEL_MASS: Final = 426.0  # thesis, table 3 [kg]


class Corrections(NamedTuple):
    """Share of each correction, 1 for the complete one; or the error of an input. Right and wrong corrections alike."""

    pivot_arm: float = 0.0
    centripetal: float = 0.0
    yaw_acceleration: float = 0.0
    trunnion: float = 0.0
    wheel_spin: float = 0.0
    arm_rotation: float = 0.0
    lateral_share: float = 0.0
    axle_roll: float = 0.0
    mirrored_joint: float = 0.0
    mirrored_side: float = 0.0
    payload_error: float = 0.0  # [kg]
    higher: float = 0.0  # [m]
    further_ahead: float = 0.0  # [m]
    hub_tare: float = 0.0
    rotation: float = 0.0
    about_joint: float = 0.0
    between_halves: float = 0.0
    pneumatic_trail: float = 0.0  # [m]
    torque_gain: float = 0.0
    articulation_zero: float = 0.0  # [rad]
    roll_zero: float = 0.0  # [rad]
    speed_error: float = 0.0


class Moment(NamedTuple):
    """The motion at one time, SI: rates of the rear frame, speed and acceleration from the wheels."""

    articulation: float
    roll: float
    pitch: float
    lift_arm: float
    bucket: float
    articulation_rate: float
    yaw_rate: float
    articulation_acceleration: float
    yaw_acceleration: float
    speed: float
    acceleration: float


MOTION: Final = len(Moment._fields)
COLUMNS: Final = MOTION + len(WheelForces._fields)
"""Of the rows of `estimate`: a Moment, then WheelForces."""


@compiled
def estimate(
    rows: Array, c: Corrections, load: float, p: Parameters, normal: Array, side: Array, torque: Array
) -> None:
    """Fill normal forces (n, 4) [N], lateral specific force at the inertial sensor [m/s2] and turning torque [N m].

    rows: (n, COLUMNS); load: payload [kg].
    """
    rear_unit = with_axle(p.rear, p.axle, p.geometry)
    for k in range(rows.shape[0]):
        r = rows[k]
        m = Moment(
            r[0] + c.articulation_zero, r[1] + c.roll_zero, r[2], r[3], r[4], r[5], r[6], r[7], r[8],
            r[9] * (1.0 + c.speed_error), r[10] * (1.0 + c.speed_error),
        )  # fmt: skip
        whole = front_unit(m.lift_arm, m.bucket, load + c.payload_error, p.front, p.arm, p.bucket)
        front = _front(
            front_unit_printed(m.lift_arm, load + c.payload_error, p.front, p.arm, p.bucket), whole, c
        )
        side[k] = _left(m, p.geometry.rear_length + p.sensors.imu_x, c)
        _normal_forces(m, c, front, p, normal[k])
        forces = WheelForces(r[11], r[12], r[13], r[14], r[15], r[16], r[17], r[18])
        torque[k] = _turning_torque(m, forces, c, front, rear_unit, p)


@compiled
def _front(printed: Body, whole: Body, c: Corrections) -> Body:
    """The front unit with its centre where the print has it, or where the whole arm turned about its pivot has it; inertias are true."""
    x = printed.x + c.arm_rotation * (whole.x - printed.x)
    z = printed.z + c.arm_rotation * (whole.z - printed.z)
    return Body(whole.mass, x, z, whole.roll_inertia, whole.pitch_inertia, whole.yaw_inertia)


@compiled
def _left(m: Moment, ahead: float, c: Corrections) -> float:
    """Specific force to the left of a point `ahead` of the rear axle [m/s2]."""
    _, across = printed_acceleration(m.acceleration, m.articulation)
    turning = c.centripetal * m.speed * m.yaw_rate + c.yaw_acceleration * ahead * m.yaw_acceleration
    return across + turning + GRAVITY * math.sin(m.roll)


@compiled
def _normal_forces(m: Moment, c: Corrections, front: Body, p: Parameters, normal: Array) -> None:
    """The three balances (71), (79), (80), and (82), (85) of the axle."""
    g, axle = p.geometry, p.axle
    d = m.articulation
    centre = machine_centre(d, front, p.rear)
    centre = Centre(
        centre.mass,
        centre.x + c.further_ahead,
        centre.y * (1.0 - 2.0 * c.mirrored_joint),
        centre.z + c.higher,
    )
    a = printed_arms(centre, d, g)
    left = _left(m, g.rear_length + centre.x, c) * (1.0 - 2.0 * c.mirrored_side)
    along, _ = printed_acceleration(m.acceleration, d)
    forward = along - GRAVITY * math.sin(m.pitch)
    weight = centre.mass * GRAVITY * math.cos(m.roll) * math.cos(m.pitch)

    pivot_side = (0.5 + c.lateral_share) * g.pivot_height
    stop = c.axle_roll * centre.mass * centre.z * left
    height = (
        centre.z
        - 0.5 * (1.0 - c.trunnion) * g.pivot_height
        + c.trunnion * axle.mass / centre.mass * axle.height
    )
    spinning = 4.0 * c.wheel_spin * p.wheel.spin_inertia * m.acceleration / p.wheel.unloaded_radius
    pitching = a.ar * weight - height * centre.mass * forward - spinning
    arm = -c.pivot_arm * centre.y  # to the right
    rolling = stop - (centre.z - pivot_side) * centre.mass * left - arm * weight
    right, other = a.b2 + arm, a.b1 - arm
    scale = (a.a1 + a.ar) * right + (a.a2 + a.ar) * other
    n1 = (pitching * right + (a.a2 + a.ar) * rolling) / scale
    n2 = (pitching * other - (a.a1 + a.ar) * rolling) / scale

    pair = weight - n1 - n2 + axle.mass * GRAVITY * math.cos(m.roll)
    shift = ((pivot_side * centre.mass + axle.height * axle.mass) * left + stop) / g.rear_track
    tare = c.hub_tare * WHEEL_MASS * GRAVITY
    normal[0], normal[1] = n1 - tare, n2 - tare
    normal[2], normal[3] = pair / 2.0 - shift - tare, pair / 2.0 + shift - tare


@compiled
def _turning_torque(
    m: Moment, f: WheelForces, c: Corrections, front: Body, rear: Body, p: Parameters
) -> float:
    """(94) of the measured tyre forces, towards the moment about the centre, the joint, or the torque between the halves."""
    g, d = p.geometry, m.articulation
    whole = machine_centre(d, front, rear)
    printed = yaw_moment_printed(f, whole.x, whole.y, d, g)
    rotated = yaw_moment(f, whole.x, whole.y, d, g)
    trail = p.wheel.pneumatic_trail
    bent = joint_torque(
        f, -trail * (f.y1 + f.y2), -trail * (f.y3 + f.y4), d, m.yaw_rate, m.articulation_rate,
        m.articulation_acceleration, front, rear, g,
    ).torque  # fmt: skip
    aligning = -c.pneumatic_trail * (f.y1 + f.y2 + f.y3 + f.y4)
    moved = c.about_joint * (yaw_moment(f, 0.0, 0.0, d, g) - rotated)
    external = (1.0 - c.torque_gain) * printed + c.rotation * (rotated - printed) + aligning + moved
    return external + c.between_halves * (bent - rotated)
