"""What is true of the machine at one instant: the record every estimate is judged against."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from plant import state as s
from plant.linkage import lift_pressure, tilt_pressure
from plant.machine import Machine
from plant.workspace import Workspace

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """State, forces and accelerations in SI; axes ISO 8855; wheels FL, FR, RL, RR.

    Field names are also the column names of a recorded truth.
    """

    time_s: float
    position: Array  # (3) articulation joint in the world [m]
    attitude: Array  # (4) quaternion w, x, y, z: world from rear frame
    roll: float  # left side up [rad]; roll, pitch and yaw are against the horizon
    pitch: float  # nose down [rad]
    yaw: float  # left [rad]
    velocity: Array  # (3) of the joint, rear-frame axes [m/s]
    angular_velocity: Array  # (3) rear frame, its own axes [rad/s]
    acceleration: Array  # (3) of the joint, without gravity, rear-frame axes [m/s2]
    imu_specific_force: Array  # (3) at the sensor, rear-frame axes [m/s2]
    cog_specific_force: Array  # (3) at the machine's centre of gravity, rear-frame axes [m/s2]
    speed: float  # of the rear axle, forward [m/s]
    articulation_angle: float
    articulation_rate: float
    oscillation_angle: float
    oscillation_rate: float
    lift_arm_angle: float
    lift_arm_rate: float
    tilt_angle: float  # bucket's bottom above the front frame's horizontal, rolled back positive
    tilt_rate: float
    wheel_speed: Array  # (4) against the carrier, rolling forward [rad/s]
    wheel_torque: Array  # (4) drive plus brake [N m]
    normal_force: Array  # (4) [N]
    longitudinal_force: Array  # (4) wheel axes [N]
    lateral_force: Array  # (4) wheel axes [N]
    aligning_moment: Array  # (4) [N m]
    slip: Array  # (4) (Omega r_e - V_x)/|V_x|, |V_x| at least 0.1 m/s
    slip_angle: Array  # (4) contact patch towards +y is positive [rad]
    tyre_deflection: Array  # (4) [m]; negative: clearance
    joint_torque: float  # of the rear frame on the front frame, turning it left [N m]
    lift_pressure: float  # head side [Pa]
    tilt_pressure: float  # head side [Pa]
    yaw_moment: float  # of the tyre forces about the centre of gravity, rear frame's z [N m]
    payload_mass: float  # [kg]
    load_transfer_ratio: float  # (right - left) / sum of the normal forces; 0 when all wheels are up

    @property
    def lifted(self) -> tuple[int, ...]:
        """Wheels that carry nothing."""
        return tuple(int(i) for i in np.flatnonzero(self.normal_force == 0.0))


def _cross(a: Array, b: Array) -> Array:
    """np.cross for two 3-vectors, without its overhead."""
    return np.array((a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]))


def truth_of(
    time_s: float, state: Array, work: Workspace, machine: Machine, payload_mass: float, gravity: float
) -> Truth:
    """The record of an evaluated state: `work` is what `derivative` left behind for it."""
    world, tree, tyres = work.places.world, work.tree, work.tyres
    motion, rise = tree.motion[s.REAR_FRAME], tree.acceleration[s.REAR_FRAME]
    turning, velocity = motion[:3].copy(), motion[3:].copy()
    reading = rise[3:] + _cross(turning, velocity)  # specific force at the joint
    geometry = machine.geometry
    imu = np.array((geometry.imu_x, 0.0, geometry.imu_z - geometry.joint_height))
    forces = tyres[:, s.T_WRENCH : s.T_WRENCH + 6].sum(axis=0)
    mass, centre = work.whole[0], work.whole[1:]
    angles, rates = state[s.JOINT : s.JOINT + s.BODIES], state[s.JOINT_RATE : s.JOINT_RATE + s.BODIES]
    wheels = slice(s.WHEEL, s.WHEEL + 4)
    normal = tyres[:, s.T_NORMAL].copy()
    total = float(normal.sum())
    lift_angle = float(angles[s.LIFT_ARM])
    return Truth(
        time_s=time_s,
        position=state[s.POSITION : s.POSITION + 3].copy(),
        attitude=state[s.ATTITUDE : s.ATTITUDE + 4].copy(),
        roll=math.atan2(world[2, 1], world[2, 2]),
        pitch=-math.asin(min(max(world[2, 0], -1.0), 1.0)),
        yaw=math.atan2(world[1, 0], world[0, 0]),
        velocity=velocity,
        angular_velocity=turning,
        acceleration=reading - gravity * world[2],
        imu_specific_force=reading + _cross(rise[:3], imu) + _cross(turning, _cross(turning, imu)),
        cog_specific_force=forces[3:] / mass,
        speed=float(velocity[0] + turning[1] * (geometry.wheel_centre_height - geometry.joint_height)),
        articulation_angle=float(angles[s.FRONT_FRAME]),
        articulation_rate=float(rates[s.FRONT_FRAME]),
        oscillation_angle=float(angles[s.REAR_AXLE]),
        oscillation_rate=float(rates[s.REAR_AXLE]),
        lift_arm_angle=lift_angle,
        lift_arm_rate=float(rates[s.LIFT_ARM]),
        tilt_angle=float(angles[s.BUCKET]),
        tilt_rate=float(rates[s.BUCKET]),
        wheel_speed=rates[wheels].copy(),
        wheel_torque=tree.effort[wheels].copy(),
        normal_force=normal,
        longitudinal_force=tyres[:, s.T_LONGITUDINAL].copy(),
        lateral_force=tyres[:, s.T_LATERAL].copy(),
        aligning_moment=tyres[:, s.T_ALIGNING].copy(),
        slip=tyres[:, s.T_SLIP].copy(),
        slip_angle=np.arctan(tyres[:, s.T_SIDE_SLIP]),
        tyre_deflection=tyres[:, s.T_DEFLECTION].copy(),
        joint_torque=float(tree.effort[s.FRONT_FRAME]),
        lift_pressure=lift_pressure(machine.lift, lift_angle, float(tree.effort[s.LIFT_ARM])),
        tilt_pressure=tilt_pressure(machine.tilt, float(tree.effort[s.BUCKET])),
        yaw_moment=float(forces[2] - _cross(centre, forces[3:])[2]),
        payload_mass=payload_mass,
        load_transfer_ratio=float(normal[1] + normal[3] - normal[0] - normal[2]) / total
        if total > 0.0
        else 0.0,
    )
