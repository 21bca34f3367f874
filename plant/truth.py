"""The true state of the machine at one instant: the record against which every estimate is judged."""

from typing import ClassVar, Self, overload

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Part:
    """Some numbers of a record that have a name."""

    def __init__(self, size: int) -> None:
        self.size = size
        self.at = 0  # their place in the row

    def __set_name__(self, owner: type["Truth"], name: str) -> None:
        self.at = owner.size
        owner.size += self.size
        owner.fields[name] = self

    def column(self, rows: Array) -> Array:
        """Their values in many rows."""
        return rows[:, self.at : self.at + self.size]


class Number(Part):
    """One number of a record."""

    def __init__(self) -> None:
        super().__init__(1)

    @overload
    def __get__(self, truth: None, owner: object) -> Self: ...

    @overload
    def __get__(self, truth: "Truth", owner: object) -> float: ...

    def __get__(self, truth: "Truth | None", owner: object) -> Self | float:
        return self if truth is None else float(truth.row[self.at])

    def column(self, rows: Array) -> Array:
        """Its values in many rows, (n,)."""
        return rows[:, self.at]


class Vector(Part):
    """Several numbers of a record that belong together."""

    @overload
    def __get__(self, truth: None, owner: object) -> Self: ...

    @overload
    def __get__(self, truth: "Truth", owner: object) -> Array: ...

    def __get__(self, truth: "Truth | None", owner: object) -> Self | Array:
        return self if truth is None else truth.row[self.at : self.at + self.size]


class Truth:
    """State, forces and accelerations in SI; axes ISO 8855; wheels FL, FR, RL, RR.

    A name for each part of one row of numbers, which the compiled plant writes; not to be changed.
    Field names are also the column names of a recorded truth.
    """

    __slots__ = ("row",)
    size: ClassVar[int] = 0
    fields: ClassVar[dict[str, Part]] = {}

    time_s = Number()
    position = Vector(3)  # articulation joint in the world [m]
    attitude = Vector(4)  # quaternion w, x, y, z: world from rear frame
    roll = Number()  # left side up [rad]; roll, pitch and yaw are against the horizon
    pitch = Number()  # nose down [rad]
    yaw = Number()  # left [rad]
    velocity = Vector(3)  # of the joint, rear-frame axes [m/s]
    angular_velocity = Vector(3)  # rear frame, its own axes [rad/s]
    acceleration = Vector(3)  # of the joint, without gravity, rear-frame axes [m/s2]
    imu_specific_force = Vector(3)  # at the sensor, rear-frame axes [m/s2]
    cog_specific_force = Vector(3)  # at the machine's centre of gravity, rear-frame axes [m/s2]
    speed = Number()  # of the rear axle, forward [m/s]
    # joint angles [rad] and their rates [rad/s]
    articulation_angle = Number()  # front frame to the left
    articulation_rate = Number()
    oscillation_angle = Number()  # rear axle against the rear frame, left side up
    oscillation_rate = Number()
    lift_arm_angle = Number()  # up from the front frame's horizontal
    lift_arm_rate = Number()
    tilt_angle = Number()  # bucket's bottom above the front frame's horizontal, rolled back positive
    tilt_rate = Number()
    wheel_speed = Vector(4)  # against the carrier, rolling forward [rad/s]
    wheel_torque = Vector(4)  # drive plus brake [N m], before losses that effects add
    normal_force = Vector(4)  # [N]
    longitudinal_force = Vector(4)  # wheel axes [N]
    lateral_force = Vector(4)  # wheel axes [N]
    aligning_moment = Vector(4)  # [N m]
    slip = Vector(4)  # (Omega r_e - V_x)/|V_x|, |V_x| at least 0.1 m/s
    slip_angle = Vector(4)  # contact patch towards +y is positive [rad]
    tyre_deflection = Vector(4)  # [m]; negative: clearance
    joint_torque = Number()  # of the rear frame on the front frame, turning it left [N m]
    lift_pressure = Number()  # head side [Pa]
    tilt_pressure = Number()  # head side [Pa]
    steering_pressure = Vector(2)  # lines for turning left and right [Pa]
    yaw_moment = Number()  # of the tyre forces about the centre of gravity, rear frame's z [N m]
    payload_mass = Number()  # [kg]
    load_transfer_ratio = Number()  # (right - left) / sum of the normal forces; 0 when all wheels are up
    # what sensors can know of wheel torque and slope
    known_torque = Vector(
        4
    )  # drive plus slipping brake [N m]; of a wheel that its brake holds, the drive alone
    inclination = Vector(
        2
    )  # pitch and roll that accelerometers at the inertial sensor take for the slope [rad]

    def __init__(self, row: Array) -> None:
        """row: (size,) numbers in the order of `fields`."""
        self.row = row

    @property
    def lifted(self) -> tuple[int, ...]:
        """Wheels that carry nothing."""
        return tuple(int(i) for i in np.flatnonzero(self.normal_force == 0.0))


def columns_of(rows: Array) -> dict[str, Array]:
    """Many rows (n, size) as one array per field of Truth, first axis time."""
    return {name: field.column(rows) for name, field in Truth.fields.items()}
