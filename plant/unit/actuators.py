"""From the driver's demand to the request to the actuators.

The dynamics own the lags and rate limits of motors, brakes and cylinders; here is what a full
pedal or joystick means, and the power limit of the motors: peak torque up to the speed at which
the power is used up, then torque = power / speed, driving and retarding alike.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

from configuration import CheckedTable
from plant.compiled import ruled
from plant.sheets.machine import Machine
from plant.unit.driver import Demand

Four = tuple[float, float, float, float]  # FL, FR, RL, RR


def four(values: Iterable[float]) -> Four:
    """The four values, one per wheel."""
    front_left, front_right, rear_left, rear_right = values
    return front_left, front_right, rear_left, rear_right


@dataclass(frozen=True, slots=True, kw_only=True)
class ActuatorParameters:
    """What the equipment adds to the machine's own actuators, SI."""

    peak_power: float  # of one motor [W]
    service_brake: Four  # friction torque of full service braking [N m]


class Abilities(NamedTuple):
    """What full demand means, SI."""

    drive_torque: Four  # peak at each wheel [N m]
    drive_power: float  # of one motor [W]
    brake_torque: Four  # full service braking [N m]
    articulation_rate: float  # this and those below [rad/s]
    lift_up: float
    lift_down: float
    tilt: float  # the same in both directions


def abilities_of(machine: Machine, parameters: ActuatorParameters) -> Abilities:
    """The machine's abilities with its equipment."""
    front, rear = machine.drive.front_peak_torque, machine.drive.rear_peak_torque
    return Abilities(
        drive_torque=(front, front, rear, rear),
        drive_power=parameters.peak_power,
        # an equipment file serves a family; a smaller machine of it may have a weaker brake
        brake_torque=four(min(torque, machine.brake.capacity) for torque in parameters.service_brake),
        articulation_rate=machine.steering.rate_limit,
        lift_up=machine.lift.raise_rate_limit,
        lift_down=machine.lift.lower_rate_limit,
        tilt=machine.tilt.rate_limit,
    )


class Request(NamedTuple):
    """The request to the actuators, SI, before and after the limits; it becomes the plant's Commands."""

    wheel_torque: Four  # drive torque [N m]
    brake_torque: Four  # available friction torque, >= 0 [N m]
    articulation_rate: float = 0.0  # to the left positive [rad/s]
    lift_rate: float = 0.0  # raising positive [rad/s]
    tilt_rate: float = 0.0  # rolling back positive [rad/s]


@ruled
def request_of(demand: Demand, abilities: Abilities) -> Request:
    """The driver's demand as torques and rates, before any limit."""
    a = abilities
    torque, brake, rate, lift, tilt = demand
    return Request(
        _times(torque, a.drive_torque),
        _times(brake, a.brake_torque),
        min(max(rate, -a.articulation_rate), a.articulation_rate),
        lift * (a.lift_up if lift > 0 else a.lift_down),
        tilt * a.tilt,
    )


@ruled
def within_power(request: Request, wheel_speed: Four, power: float) -> Request:
    """The request with drive torques cut to |torque speed| <= power [W], wheel by wheel."""
    (a, b, c, d), (i, j, k, m) = request.wheel_torque, wheel_speed
    torque = _cut(a, i, power), _cut(b, j, power), _cut(c, k, power), _cut(d, m, power)
    # by place, as everywhere where a request is made: compiled code knows no _replace
    return Request(
        torque, request.brake_torque, request.articulation_rate, request.lift_rate, request.tilt_rate
    )


@ruled
def _cut(torque: float, speed: float, power: float) -> float:
    return math.copysign(power / abs(speed), torque) if abs(torque) * abs(speed) > power else torque


@ruled
def _times(share: float, of: Four) -> Four:
    return share * of[0], share * of[1], share * of[2], share * of[3]


def read_actuators(table: CheckedTable) -> ActuatorParameters:
    """The [actuators] table of an equipment file."""
    front, rear = table.numbers("service_brake_front_rear_kn_m", unit="kN m", count=2, low=0.0, high=50.0)
    parameters = ActuatorParameters(
        peak_power=table.number("peak_power_kw", unit="kW", low=1.0, high=500.0) * 1e3,
        service_brake=(front * 1e3, front * 1e3, rear * 1e3, rear * 1e3),
    )
    table.finish()
    return parameters
