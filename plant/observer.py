"""Fills the record of what is true (`plant.truth`) from the plant's state, for plant and measurement-driven replay."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plant.compiled import inlined, uncounted
from plant.physics import state as s
from plant.physics.dynamics import advance, derivative, drive_torque
from plant.physics.linkage import LINKAGE, pressures
from plant.physics.parameters import (
    P_CYLINDERS,
    P_GRAVITY,
    P_LIFT,
    P_LINKAGE,
    P_STEERING,
    P_TILT,
    SERVO_RELIEF,
)
from plant.physics.steering import STEERING, steering_pressures
from plant.physics.workspace import Workspace
from plant.sheets.machine import Machine
from plant.truth import Truth

Array = NDArray[np.float64]
Triple = tuple[float, float, float]

# Places in the row, for compiled code. An angle of a joint is followed by its rate.
TIME: Final = Truth.time_s.at
POSITION: Final = Truth.position.at
ATTITUDE: Final = Truth.attitude.at
ROLL: Final = Truth.roll.at
PITCH: Final = Truth.pitch.at
YAW: Final = Truth.yaw.at
VELOCITY: Final = Truth.velocity.at
ANGULAR_VELOCITY: Final = Truth.angular_velocity.at
ACCELERATION: Final = Truth.acceleration.at
IMU_FORCE: Final = Truth.imu_specific_force.at
COG_FORCE: Final = Truth.cog_specific_force.at
SPEED: Final = Truth.speed.at
ARTICULATION: Final = Truth.articulation_angle.at
OSCILLATION: Final = Truth.oscillation_angle.at
LIFT_ARM: Final = Truth.lift_arm_angle.at
TILT: Final = Truth.tilt_angle.at
WHEEL_SPEED: Final = Truth.wheel_speed.at
WHEEL_TORQUE: Final = Truth.wheel_torque.at
NORMAL: Final = Truth.normal_force.at
LONGITUDINAL: Final = Truth.longitudinal_force.at
LATERAL: Final = Truth.lateral_force.at
ALIGNING: Final = Truth.aligning_moment.at
SLIP: Final = Truth.slip.at
SLIP_ANGLE: Final = Truth.slip_angle.at
DEFLECTION: Final = Truth.tyre_deflection.at
JOINT_TORQUE: Final = Truth.joint_torque.at
LIFT_PRESSURE: Final = Truth.lift_pressure.at
TILT_PRESSURE: Final = Truth.tilt_pressure.at
STEERING_PRESSURE: Final = Truth.steering_pressure.at
YAW_MOMENT: Final = Truth.yaw_moment.at
PAYLOAD: Final = Truth.payload_mass.at
LOAD_TRANSFER: Final = Truth.load_transfer_ratio.at
KNOWN_TORQUE: Final = Truth.known_torque.at
INCLINATION: Final = Truth.inclination.at

# What only the record needs of a machine: places from the joint.
O_IMU_X: Final = 0
O_IMU_Z: Final = 1
O_AXLE_Z: Final = 2
MEASURES: Final = 3


class Observer:
    """Makes the records of one machine."""

    def __init__(self, machine: Machine, payload_mass: float) -> None:
        geometry = machine.geometry
        joint = geometry.joint_height
        self._payload_mass = payload_mass
        self.measures = np.array(
            (*(geometry.imu_x, geometry.imu_z - joint, geometry.wheel_centre_height - joint),)
        )

    def truth(
        self, time_s: float, state: Array, command: Array, p: Array, work: Workspace, active: Array | None
    ) -> Truth:
        """The record of a state under a command; arguments as of `dynamics.derivative`, `work` left as it leaves it."""
        row = np.empty(Truth.size)
        observe(row, state, command, p, work, active, self.measures)
        return self.finished(row, time_s)

    def finished(self, row: Array, time_s: float) -> Truth:
        """The record of a row that `observe` has filled; the row is not to be changed any more."""
        row[TIME], row[PAYLOAD] = time_s, self._payload_mass
        row.flags.writeable = False
        return Truth(row)


@uncounted
def advance_and_observe(
    state: Array,
    command: Array,
    p: Array,
    step: float,
    count: int,
    fourth_order: bool,
    work: Workspace,
    active: Array | None,
    row: Array,
    measures: Array,
) -> bool:
    """`count` steps with constant commands, and the row at their end; whether the state is still finite."""
    # one call from Python instead of two: handing over the workspace's arrays takes as long as two steps
    advance(state, command, p, step, count, fourth_order, work, active)
    observe(row, state, command, p, work, active, measures)
    finite = True
    for i in range(s.STATES):
        finite = finite and math.isfinite(state[i])
    return finite


@uncounted
def observe(
    row: Array,
    state: Array,
    command: Array,
    p: Array,
    work: Workspace,
    active: Array | None,
    measures: Array,
) -> None:
    """Evaluate the state and fill the row, but for time and payload."""
    derivative(state, command, p, 0.0, work, active)
    _observe_frame(row, state, p, work, measures)
    _observe_joints(row, state, p, work)
    _observe_tyres(row, work)
    linkage, effort = p[P_LINKAGE : P_LINKAGE + LINKAGE], work.tree.effort
    lift, tilt = pressures(linkage, row[LIFT_ARM], row[TILT], effort[s.LIFT_ARM], effort[s.BUCKET])
    left, right = steering_pressures(
        p[P_CYLINDERS : P_CYLINDERS + STEERING], row[ARTICULATION], row[JOINT_TORQUE]
    )
    # at the end of a stroke the stop carries the load beyond the relief pressure, so the oil never shows more than that
    row[LIFT_PRESSURE] = min(lift, p[P_LIFT + SERVO_RELIEF])
    row[TILT_PRESSURE] = min(tilt, p[P_TILT + SERVO_RELIEF])
    row[STEERING_PRESSURE] = min(left, p[P_STEERING + SERVO_RELIEF])
    row[STEERING_PRESSURE + 1] = min(right, p[P_STEERING + SERVO_RELIEF])


@uncounted
def _observe_frame(row: Array, state: Array, p: Array, work: Workspace, measures: Array) -> None:
    """Where the rear frame is and how it moves."""
    world, motion = work.places.world, work.tree.motion[s.REAR_FRAME]
    rise = work.tree.acceleration[s.REAR_FRAME]
    turning, velocity = motion[:3], motion[3:]
    for i in range(3):
        row[POSITION + i] = state[s.POSITION + i]
        row[VELOCITY + i] = velocity[i]
        row[ANGULAR_VELOCITY + i] = turning[i]
    for i in range(4):
        row[ATTITUDE + i] = state[s.ATTITUDE + i]
    row[ROLL] = math.atan2(world[2, 1], world[2, 2])
    row[PITCH] = -math.asin(min(max(world[2, 0], -1.0), 1.0))
    row[YAW] = math.atan2(world[1, 0], world[0, 0])
    row[SPEED] = velocity[0] + turning[1] * measures[O_AXLE_Z]
    imu = (measures[O_IMU_X], 0.0, measures[O_IMU_Z])
    coriolis = _cross(turning, velocity)
    tangential, centripetal = _cross(rise[:3], imu), _cross(turning, _cross(turning, imu))
    for i in range(3):
        at_joint = rise[3 + i] + coriolis[i]  # specific force: the solver's acceleration excludes gravity
        row[ACCELERATION + i] = at_joint - p[P_GRAVITY] * world[2, i]
        row[IMU_FORCE + i] = at_joint + tangential[i] + centripetal[i]
    ahead, aside, up = row[IMU_FORCE], row[IMU_FORCE + 1], row[IMU_FORCE + 2]
    row[INCLINATION] = math.atan2(-ahead, math.sqrt(aside * aside + up * up))
    row[INCLINATION + 1] = math.atan2(aside, up)


@uncounted
def _observe_joints(row: Array, state: Array, p: Array, work: Workspace) -> None:
    """Angles, rates and torques of the joints."""
    effort = work.tree.effort
    for at, body in (
        (ARTICULATION, s.FRONT_FRAME),
        (OSCILLATION, s.REAR_AXLE),
        (LIFT_ARM, s.LIFT_ARM),
        (TILT, s.BUCKET),
    ):
        row[at] = state[s.JOINT + body]
        row[at + 1] = state[s.JOINT_RATE + body]
    row[JOINT_TORQUE] = effort[s.FRONT_FRAME]
    for wheel in range(4):
        row[WHEEL_SPEED + wheel] = state[s.JOINT_RATE + s.WHEEL + wheel]
        stick = state[s.STICK + wheel]
        rolling = drive_torque(state, p, wheel) - stick * state[s.BRAKE + wheel]
        row[WHEEL_TORQUE + wheel] = effort[s.WHEEL + wheel] if stick == 0.0 else rolling
        # Motor current and brake pressure give this one. Pressure says what a brake can hold, not what it holds (stick 0).
        row[KNOWN_TORQUE + wheel] = rolling


@uncounted
def _observe_tyres(row: Array, work: Workspace) -> None:
    """Forces of the road, wheel by wheel and together."""
    tyres, whole = work.tyres, work.whole
    mz, fx, fy, fz = 0.0, 0.0, 0.0, 0.0
    for wheel in range(4):
        tyre = tyres[wheel]
        row[NORMAL + wheel] = tyre[s.T_NORMAL]
        row[LONGITUDINAL + wheel] = tyre[s.T_LONGITUDINAL]
        row[LATERAL + wheel] = tyre[s.T_LATERAL]
        row[ALIGNING + wheel] = tyre[s.T_ALIGNING]
        row[SLIP + wheel] = tyre[s.T_SLIP]
        # not numpy's, whose last bit is another on processors with wider vectors
        row[SLIP_ANGLE + wheel] = math.atan(tyre[s.T_SIDE_SLIP])
        row[DEFLECTION + wheel] = tyre[s.T_DEFLECTION]
        mz += tyre[s.T_WRENCH + 2]
        fx, fy, fz = fx + tyre[s.T_WRENCH + 3], fy + tyre[s.T_WRENCH + 4], fz + tyre[s.T_WRENCH + 5]
    row[COG_FORCE], row[COG_FORCE + 1], row[COG_FORCE + 2] = fx / whole[0], fy / whole[0], fz / whole[0]
    row[YAW_MOMENT] = mz - (whole[1] * fy - whole[2] * fx)
    front_left, front_right = row[NORMAL], row[NORMAL + 1]
    rear_left, rear_right = row[NORMAL + 2], row[NORMAL + 3]
    total = front_left + front_right + rear_left + rear_right
    balance = front_right + rear_right - front_left - rear_left
    row[LOAD_TRANSFER] = balance / total if total > 0.0 else 0.0


@inlined
def _cross(a: Array | Triple, b: Array | Triple) -> Triple:
    """a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
